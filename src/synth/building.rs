//! Buildings: what is at the bottom, storeys and a roof of `things.toml`, stacked and stretched to measure.

use glam::{Affine3A, Mat3A, Vec3A, vec3};
use rand::RngExt;

use super::random::{Random, pick};
use super::scene::Model;
use super::things;

/// Measures of one building, metres; its front is the line y = 0, x from -width / 2 to width / 2.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measures {
    pub(super) width: f32,
    pub(super) depth: f32,
    pub(super) floors: u32,
    /// A house with a gabled roof and a porch, else a block with shops and a flat roof.
    pub(super) house: bool,
}

/// A building of these measures with a face of its own.
pub(super) fn model(measures: Measures, random: &mut Random) -> Model {
    let Measures { width, depth, floors, house } = measures;
    let (bottom, ground, storey, storeys, roof, rise) = if house {
        ("house_base", 0.4, "house_storey", floors, "gable", depth * random.random_range(0.3..=0.5))
    } else {
        ("shops", 4.0, "storey", floors - 1, "flat_roof", 1.0)
    };
    let height = random.random_range(2.8..=3.3);
    // The place of a piece that begins at height `z` and is stretched by `rise`.
    let at = |z: f32, rise: f32| Affine3A {
        matrix3: Mat3A::from_diagonal(vec3(width, depth, rise)),
        translation: Vec3A::Z * z,
    };
    let storey = pick(things::of(storey), random);
    let mut parts = pick(things::of(bottom), random).parts(&at(0.0, 1.0), random);
    for floor in 0..storeys {
        parts.extend(storey.parts(&at(ground + floor as f32 * height, height), random));
    }
    let eaves = ground + storeys as f32 * height;
    parts.extend(pick(things::of(roof), random).parts(&at(eaves, rise), random));
    Model::new(parts)
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat3A, Vec3A};

    use super::super::material::Material;
    use super::super::random::sequence;
    use super::super::scene::{Owner, Placed, Window};
    use super::super::street::Object;
    use super::*;

    #[test]
    fn storeys_have_walls_reveals_and_glass() {
        // The first kind of storey, stretched to 42 x 16 x 3 m: bays of 3 m, windows 1.4 m wide from 0.9 to 2.34 m.
        let parts = things::of("storey")[0]
            .parts(&Affine3A::from_scale(vec3(42.0, 16.0, 3.0)), &mut sequence(1, 2, 3));
        let object = Object { id: 1, class: 5, kind: "building", base: DVec3::ZERO, height: 3.0, s: 0.0 };
        let owner = Owner::Object(object.into());
        let (model, at, turn) = (Model::new(parts).into(), DVec3::ZERO, Mat3A::IDENTITY);
        let window = Window::new(DVec3::ZERO, &[Placed { model, at, turn, owner }]);
        for (origin, direction, t, material) in [
            ([1.5, -5.0, 1.5], [0.0, 1.0, 0.0], 5.2, Material::Glass), // middle of the first bay to the right
            ([0.0, -5.0, 1.5], [0.0, 1.0, 0.0], 5.0, Material::Plaster), // between windows
            ([1.5, -5.0, 0.8], [0.0, 1.0, 0.0], 5.0, Material::Plaster), // below the sill
            ([1.5, -5.0, 2.5], [0.0, 1.0, 0.0], 5.0, Material::Plaster), // above the window
            ([1.5, 21.0, 1.5], [0.0, -1.0, 0.0], 5.2, Material::Glass), // from the back
            ([-26.0, 1.6, 1.5], [1.0, 0.0, 0.0], 5.2, Material::Glass), // from the side
            ([-26.0, 0.3, 1.5], [1.0, 0.0, 0.0], 5.0, Material::Plaster), // its corner
            ([-2.9, -5.0, 1.5], [1.0, 1.0, 0.0], 5.1, Material::Plaster), // at 45 degrees: the reveal at x = 2.2
        ] {
            let (o, d) = (Vec3A::from(origin), Vec3A::from(direction));
            let hit = window.hit(o, d, 0.0, 100.0).unwrap();
            assert!((hit.t - t).abs() < 0.03, "{origin:?}: {}", hit.t);
            assert_eq!(window.surface(&hit, o, d).0.material, material, "{origin:?}");
        }
    }
}
