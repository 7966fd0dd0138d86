//! Temporary.
use std::io::Write;
use super::OutputError;
/// x
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub struct ObjectRow { pub id: u32, pub points: u64, pub min: [f64;3], pub max: [f64;3], pub centroid: [f64;3], pub ground_z: Option<f64>, pub height_above_ground: Option<f64>, pub base_above_ground: Option<f64>, pub footprint: Vec<[f64;2]>, pub area_m2: f64, pub chainage_m: f64, pub offset_m: f64, pub files: Vec<String> }
/// x
pub fn write_csv(rows: impl Iterator<Item = ObjectRow>, out: &mut dyn Write) -> Result<(), OutputError> {
    for r in rows { let _ = writeln!(out, "{r:?}"); }
    Ok(())
}
/// x
pub fn write_geojson(rows: impl Iterator<Item = ObjectRow>, _epsg: Option<u32>, out: &mut dyn Write) -> Result<(), OutputError> {
    let _ = writeln!(out, "{}", rows.count());
    Ok(())
}
