//! Settings and fixed values of `street`: lengths, classes, and the numbers of its steps.

use serde::Deserialize;

use crate::config::ConfigError;
use crate::model::{Hedge, Kind, Lattice};

/// Name of the method and of its section.
pub(crate) const NAME: &str = "street";

/// Numbers of the steps, in their order.
pub(crate) const STEP_VOXELS: usize = 0;
pub(crate) const STEP_CLASSES: usize = 1;
pub(crate) const STEP_CONTEXT: usize = 2;
pub(crate) const STEP_CHAINS: usize = 3;
pub(crate) const STEP_CORES: usize = 4;
pub(crate) const STEP_EDGES: usize = 5;
pub(crate) const STEP_GROWTH: usize = 6;
pub(crate) const STEP_LEFTOVERS: usize = 7;
pub(crate) const STEP_OBJECTS: usize = 8;

/// Edge of a voxel in metres. Not a setting: the model was trained with it. The thinnest objects (signs,
/// stems, rails) are about 0.1 m, and the spacing of points is mostly below 0.1 m.
pub(crate) const EDGE_M: f64 = 0.15;

/// Number of classes. The code of a class is its index plus one: ground (none of the others), tree, pole,
/// vehicle, building, fence or hedge, small, wire.
pub(crate) const CLASSES: usize = 8;

/// The kind of scene that a built-in model learned from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scene {
    /// Streets of many kinds.
    Street,
    /// Tracks through forests and plantations. The model was trained without buildings and vehicles.
    Forest,
}

/// A class of objects in the settings. Its number is its index in the shares of a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WantedClass {
    /// Trees.
    Tree = 1,
    /// Lamps, signs, masts.
    Pole = 2,
    /// Cars, vans, lorries, buses.
    Vehicle = 3,
    /// Buildings.
    Building = 4,
    /// Fences, walls, hedges, bushes.
    Fence = 5,
    /// Persons and street furniture.
    Small = 6,
    /// Wires.
    Wire = 7,
}

impl WantedClass {
    /// All of them.
    const ALL: [Self; CLASSES - 1] =
        [Self::Tree, Self::Pole, Self::Vehicle, Self::Building, Self::Fence, Self::Small, Self::Wire];
}

/// Edge of a voxel in lattice units.
pub(crate) fn edge(lattice: Lattice) -> u32 {
    u32::try_from(lattice.units(EDGE_M)).unwrap_or(u32::MAX)
}

/// Settings of the section `[street]`.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StreetConfig {
    /// Smallest number of points of an object, 1 to 1,000,000. Default 20. A fence needs twice as many; a
    /// tree, a vehicle or a building needs three times as many. If the model classifies an object as whole,
    /// this number is enough; a tree, or an object without a core, then needs 1.5 times as many. Smaller
    /// objects that join no other get no id.
    pub min_points: u64,
    /// Classes of the objects that get an id. Default: all. Objects of other classes are found too, because
    /// growth needs them, but they get no id.
    pub classes: Vec<WantedClass>,
    /// Selects the built-in model that classifies voxels, and how thick trunks may be. Default: streets.
    pub scene: Scene,
    /// File of another model that classifies voxels. Empty for the model of the scene.
    pub model: String,
}

impl Default for StreetConfig {
    fn default() -> Self {
        Self {
            min_points: 20,
            classes: WantedClass::ALL.to_vec(),
            scene: Scene::Street,
            model: String::new(),
        }
    }
}

impl StreetConfig {
    /// Smallest number of points at which the model examines a tree with a core, or an object without one:
    /// 1.5 times [`Self::min_points`]. Smaller ones are mostly pieces of other objects
    /// (benches/results/street.md).
    pub(crate) fn min_uncertain(&self) -> u64 {
        3 * self.min_points / 2
    }

    /// Whether an object of the class with this index has enough points to count as an object without further
    /// evidence. On 18 labelled drives, 10 of 75 trees, fences and buildings with fewer points were right; on
    /// 14, none of 11 vehicles.
    pub(crate) fn is_large(&self, class: u8, points: u64) -> bool {
        let times = match WantedClass::ALL.into_iter().find(|of| *of as u8 == class) {
            Some(WantedClass::Tree | WantedClass::Vehicle | WantedClass::Building) => 3,
            Some(WantedClass::Fence) => 2,
            _ => 1,
        };
        points >= times * self.min_points
    }

    /// Whether objects of the class with this index get an id.
    pub(crate) fn wants(&self, class: u8) -> bool {
        self.classes.iter().any(|wanted| *wanted as u8 == class)
    }

    /// The kinds of the objects that get an id. Those of fences include hedges.
    pub(crate) fn kinds(&self) -> Vec<Kind> {
        let mut kinds = Vec::new();
        for wanted in &self.classes {
            let kind = Kind::new(*wanted as u8 + 1, 0);
            kinds.push(kind);
            if *wanted == WantedClass::Fence {
                kinds.extend([Hedge::Low, Hedge::Medium].map(|hedge| Kind { hedge, ..kind }));
            }
        }
        kinds
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`ConfigError::Value`] with the key and the range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        if !(1..=1_000_000).contains(&self.min_points) {
            return Err(ConfigError::value("street.min_points", self.min_points, "1 to 1,000,000 points"));
        }
        if self.classes.is_empty() {
            return Err(ConfigError::value("street.classes", "[]", "at least one class of objects"));
        }
        Ok(())
    }
}
