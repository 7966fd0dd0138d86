//! Further fields of points (intensity, colours), as the pass `fields` wrote them.

use crate::error::Result;
use crate::input::InputError;
use crate::model::{Field, PointId};
use crate::run::drive::{Drive, PerPoint};
use crate::store::RunDir;

/// Columns of further fields.
#[derive(Debug)]
pub(crate) struct StoredFields {
    /// The fields that a method asks for, coordinates included.
    pub(crate) fields: Vec<Field>,
    /// The columns of those fields that are not coordinates.
    pub(crate) columns: Vec<(Field, PerPoint<u16>)>,
}

impl StoredFields {
    /// The columns of those of `fields` that are not coordinates. The passes whose folders begin with
    /// `writers` write them.
    ///
    /// # Errors
    /// When a file has no such field.
    pub(crate) fn of(drive: &Drive, fields: &[Field], writers: &str) -> Result<Self> {
        let mut columns = Vec::new();
        for &field in fields.iter().filter(|field| field.axis().is_none()) {
            for file in drive.catalog.files() {
                if file.layout().field(field).is_none() {
                    let path = file.path().to_owned();
                    let point_format = file.layout().point_format;
                    return Err(InputError::NoField { path, point_format, field: field.name() }.into());
                }
            }
            columns.push((field, PerPoint::new(format!("field-{}", field.name()), writers)));
        }
        Ok(Self { fields: fields.to_vec(), columns })
    }

    /// Opens or creates the columns.
    pub(crate) fn open(&self, run_dir: &RunDir, drive: &Drive) -> Result<()> {
        self.columns.iter().try_for_each(|(_, column)| column.open(run_dir, drive))
    }

    /// The fields of points by their ids. The ids are mostly ascending.
    pub(crate) fn of_points(&self, drive: &Drive, ids: &[PointId]) -> Result<Vec<(Field, Vec<u16>)>> {
        let mut fields = Vec::new();
        for (field, column) in &self.columns {
            fields.push((*field, column.of_points(drive, ids)?));
        }
        Ok(fields)
    }
}
