//! Further fields of points (intensity, colours), as the pass `fields` stored them.

use crate::error::Result;
use crate::input::InputError;
use crate::model::{Field, PointId};
use crate::run::drive::{Drive, PerPoint};

/// The fields among `fields` that are not coordinates. Every file must have them.
///
/// # Errors
/// When a file has no such field.
pub(crate) fn stored_fields(drive: &Drive, fields: &[Field]) -> Result<Vec<Field>> {
    let stored: Vec<Field> = fields.iter().copied().filter(|field| field.axis().is_none()).collect();
    for field in &stored {
        for file in drive.catalog.files() {
            if file.layout().field(*field).is_none() {
                let path = file.path().to_owned();
                let point_format = file.layout().point_format;
                return Err(InputError::NoField { path, point_format, field: field.name() }.into());
            }
        }
    }
    Ok(stored)
}

/// The values of further fields.
#[derive(Debug)]
pub(crate) struct StoredFields {
    pub(crate) columns: Vec<(Field, PerPoint<u16>)>,
}

impl StoredFields {
    /// The fields of points by their ids. The ids are mostly ascending.
    pub(crate) fn of_points(&self, drive: &Drive, ids: &[PointId]) -> Result<Vec<(Field, Vec<u16>)>> {
        let mut fields = Vec::new();
        for (field, column) in &self.columns {
            fields.push((*field, drive.values_of(column, ids)?));
        }
        Ok(fields)
    }
}
