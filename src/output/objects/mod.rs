//! The table of objects as files. A format writes all columns that it is given, and does not depend on any of
//! them.
//!
//! A format is one file here and one line in [`REGISTRY`].

mod csv;
mod geojson;
#[cfg(feature = "gpkg")]
mod geopackage;
mod number;
mod ply;
mod table;

pub(crate) use number::{places, rounded};
pub use table::{DriveShape, ObjectFormat, ObjectRow, ObjectTable, TileShape};

/// One line of the registry.
#[derive(Debug, Clone, Copy)]
pub struct ObjectFormatEntry {
    /// Name of the file in the output folder.
    pub file_name: &'static str,
    /// The format.
    pub format: &'static dyn ObjectFormat,
}

impl ObjectFormatEntry {
    /// The name of the format in settings: the extension of its file.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.file_name.rsplit('.').next().unwrap_or(self.file_name)
    }
}

/// Every format, in the order in which the files are written.
pub const REGISTRY: &[ObjectFormatEntry] = &[
    ObjectFormatEntry { file_name: "objects.csv", format: &csv::Csv },
    ObjectFormatEntry { file_name: "objects.geojson", format: &geojson::GeoJson },
    #[cfg(feature = "gpkg")]
    ObjectFormatEntry { file_name: "objects.gpkg", format: &geopackage::GeoPackage },
];

/// Every format of the table of surfaces, in the order in which the files are written. The rows are rows of
/// an [`ObjectTable`] with an outline in space.
pub const SURFACES: &[ObjectFormatEntry] = &[
    ObjectFormatEntry { file_name: "surfaces.csv", format: &csv::Csv },
    ObjectFormatEntry { file_name: "surfaces.geojson", format: &geojson::GeoJson },
    ObjectFormatEntry { file_name: "surfaces.ply", format: &ply::Ply },
];

#[cfg(test)]
pub(crate) use table::tests;
