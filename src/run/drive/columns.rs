//! Columns on disk, made durable.

use bytemuck::Pod;

use crate::error::Result;
use crate::store::{Column, StoreError};

/// Makes everything written to `columns` survive a power cut.
pub(crate) fn sync_columns<'a, T: Pod + Default>(
    columns: impl IntoIterator<Item = &'a Column<T>>,
) -> Result<()> {
    for column in columns {
        column.sync().map_err(StoreError::io("sync", column.path()))?;
    }
    Ok(())
}
