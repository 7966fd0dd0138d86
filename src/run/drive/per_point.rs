//! One value per point of the drive on disk: each is written once, by a pass whose units own whole runs of records.

use std::sync::OnceLock;

use bytemuck::Pod;

use super::columns::sync_columns;
use super::opened::Drive;
use crate::error::{Error, Result};
use crate::store::{Column, RunDir, StoreError};

/// One value per point of the drive, a column per file.
#[derive(Debug)]
pub(crate) struct PerPoint<T> {
    /// Folder in the state.
    name: String,
    /// How the folders of the passes begin that write it: without the columns their units have nothing to show.
    writers: String,
    files: OnceLock<Vec<Column<T>>>,
}

impl<T: Pod + Default> PerPoint<T> {
    /// The values in the folder `name`, which the passes whose folders begin with `writers` write.
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

    /// Writes the values of consecutive records of a file.
    pub(crate) fn write_run(&self, file: usize, first: u64, values: &[T]) -> Result<()> {
        let column = &self.columns()?[file];
        Ok(column.write_run(first, values).map_err(StoreError::io("write", column.path()))?)
    }

    /// Makes everything written so far survive a power cut.
    pub(crate) fn sync(&self) -> Result<()> {
        sync_columns(self.columns()?)
    }
}
