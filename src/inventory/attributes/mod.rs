//! The attributes of objects, one file each.

pub(crate) mod attribute;
mod base;
mod centroid;
mod class;
mod clearance;
mod crown_size;
mod cut;
mod direction;
mod extent;
mod files;
mod footprint;
mod ground_height;
mod hedge;
mod height;
mod id;
mod inclination;
mod points;
mod size;
mod station;
mod stem_diameter;
mod touches;
mod uid;

use self::attribute::Attribute;

/// Every attribute, in the order of its columns.
pub static REGISTRY: &[&dyn Attribute] = &[
    &id::Id,
    &uid::Uid,
    &class::Class,
    &hedge::Hedge,
    &points::Points,
    &base::Base,
    &station::StationOnAxis,
    &height::Height,
    &size::Size,
    &footprint::Footprint,
    &crown_size::CrownSize,
    &stem_diameter::StemDiameter,
    &inclination::Inclination,
    &clearance::Clearance,
    &touches::Touches,
    &cut::Cut,
    &extent::Extent,
    &centroid::Centroid,
    &ground_height::GroundHeight,
    &files::Files,
];
