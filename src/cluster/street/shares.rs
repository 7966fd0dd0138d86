//! The classes of voxels: their indices, and the class with the largest share.

use super::settings::CLASSES;

/// Index of a class in the shares of a voxel: its code minus one, see `config/classes.toml`.
pub(crate) const GROUND: u8 = 0;
pub(crate) const TREE: u8 = 1;
pub(crate) const POLE: u8 = 2;
pub(crate) const VEHICLE: u8 = 3;
pub(crate) const BUILDING: u8 = 4;
pub(crate) const FENCE: u8 = 5;
pub(crate) const SMALL: u8 = 6;
pub(crate) const WIRE: u8 = 7;

/// Whether pieces of this class may be one object although they do not touch.
pub(crate) fn unites(class: u8) -> bool {
    matches!(class, VEHICLE | FENCE | WIRE)
}

/// Whether the extent of components of this class in the plane is needed.
pub(crate) fn spans(class: u8) -> bool {
    unites(class) || class == BUILDING
}

/// The class with the largest share. Of equal shares, the first class wins.
pub(crate) fn class<const N: usize>(shares: &[u8; N]) -> u8 {
    let mut best = 0;
    for class in 1..N {
        if shares[class] > shares[best] {
            best = class;
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "there are at most 8 classes")]
    let best = best as u8;
    best
}

/// The class of every voxel.
pub(crate) fn classes(shares: &[[u8; CLASSES]]) -> Vec<u8> {
    shares.iter().map(class).collect()
}

/// The shares of a voxel whose object decided its class: a twentieth of its earlier share for each other
/// class, and the rest, at least 95 %, for this class.
pub(crate) fn decided(shares: &[u8; CLASSES], class: u8) -> [u8; CLASSES] {
    let mut changed = shares.map(|share| share / 20);
    let rest: u8 = changed.iter().sum();
    changed[usize::from(class)] += 255 - rest;
    changed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cluster::street::settings::{NAME, StreetConfig};
    use crate::config::{self, ConfigError};

    fn read(text: &str) -> Result<StreetConfig, ConfigError> {
        let config: StreetConfig = config::section(NAME, &text.parse().unwrap())?;
        config.validate()?;
        Ok(config)
    }

    #[test]
    fn wanted_classes_are_named_and_at_least_one() {
        let names = ["tree", "pole", "vehicle", "building", "fence", "small", "wire"];
        for (name, class) in names.into_iter().zip([TREE, POLE, VEHICLE, BUILDING, FENCE, SMALL, WIRE]) {
            let config = read(&format!("classes = [\"{name}\"]")).unwrap();
            assert!((GROUND..=WIRE).all(|other| config.wants(other) == (other == class)), "{name}");
        }
        let all = read("").unwrap();
        assert!((TREE..=WIRE).all(|class| all.wants(class)) && !all.wants(GROUND));
        let least = |class| (0..).find(|&points| all.is_large(class, points)).unwrap();
        let of_class = [TREE, POLE, VEHICLE, BUILDING, FENCE, SMALL, WIRE].map(least);
        assert_eq!(of_class, [60, 20, 60, 60, 40, 20, 20]);
        let error = read("classes = []").unwrap_err().to_string();
        assert!(error.contains("at least one class of objects"), "{error}");
        let error = read("classes = [\"shrub\"]").unwrap_err().to_string();
        assert!(error.contains("shrub") && error.contains("tree"), "{error}");
    }
}
