//! Columns with one value per point on disk. The units of the writing pass own whole ranges of records, so
//! each value is written once.

use std::sync::OnceLock;

use bytemuck::Pod;

use super::columns::sync_columns;
use super::opened::Drive;
use crate::error::{Error, Result};
use crate::model::PointId;
use crate::store::{Column, RunDir, StoreError};

/// Number of records that are read from a column at once.
const PAGE: u64 = 65_536;

/// One value per point of the drive, a column per file.
#[derive(Debug)]
pub(crate) struct PerPoint<T> {
    /// Folder in the state.
    name: String,
    /// Prefix of the folders of the passes that write it. If a column is lost, these passes are removed.
    writers: String,
    files: OnceLock<Vec<Column<T>>>,
}

impl<T: Pod + Default> PerPoint<T> {
    /// The values in the folder `name`. The passes whose folders begin with `writers` write them.
    pub(crate) fn new(name: impl Into<String>, writers: impl Into<String>) -> Self {
        Self { name: name.into(), writers: writers.into(), files: OnceLock::new() }
    }

    /// Opens or creates the columns.
    pub(crate) fn open(&self, run_dir: &RunDir, drive: &Drive) -> Result<()> {
        let mut columns = Vec::new();
        for (number, file) in drive.catalog.files().iter().enumerate() {
            columns.push(run_dir.column(&self.name, number, file.point_count(), &self.writers)?);
        }
        self.files.set(columns).map_err(|_| Error::bug(format!("columns {} were opened twice", self.name)))
    }

    fn columns(&self) -> Result<&[Column<T>]> {
        let columns =
            self.files.get().ok_or_else(|| Error::bug(format!("columns {} are not open", self.name)))?;
        Ok(columns)
    }

    /// Reads the values of consecutive records of a file.
    pub(crate) fn read(&self, file: usize, first: u64, values: &mut [T]) -> Result<()> {
        let column = &self.columns()?[file];
        Ok(column.read(first, values).map_err(StoreError::io("read", column.path()))?)
    }

    /// The values of points by their ids. The ids are mostly ascending.
    pub(crate) fn of_points(&self, drive: &Drive, ids: &[PointId]) -> Result<Vec<T>> {
        let mut values = Vec::with_capacity(ids.len());
        let mut page = Vec::new();
        let mut page_ids = PointId::default()..PointId::default();
        for &id in ids {
            if !page_ids.contains(&id) {
                let (file, record) = drive.locate(id);
                let first = record / PAGE * PAGE;
                let count = PAGE.min(drive.file(file).point_count() - first);
                page.resize(usize::try_from(count).unwrap_or(0), T::default());
                self.read(file, first, &mut page)?;
                let first_id = drive.catalog.first_id(file) + first;
                page_ids = first_id..first_id + count;
            }
            values.push(page[usize::try_from(id - page_ids.start).unwrap_or(0)]);
        }
        Ok(values)
    }

    /// Writes the values of consecutive records of a file.
    pub(crate) fn write_run(&self, file: usize, first: u64, values: &[T]) -> Result<()> {
        let column = &self.columns()?[file];
        Ok(column.write_run(first, values).map_err(StoreError::io("write", column.path()))?)
    }

    /// Syncs all written values to the disk.
    pub(crate) fn sync(&self) -> Result<()> {
        sync_columns(self.columns()?)
    }
}
