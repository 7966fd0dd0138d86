//! What each pass depends on, by name: the lists behind fingerprints and behind `status --why`.

use crate::config::Config;
use crate::run::drive::Drive;
use crate::run::methods::{Chain, with_section};
use crate::run::scene::Scene;
use crate::store::Inputs;
use crate::tiling::Plan;

pub(crate) const SURVEY: &str = "pass-00-survey";
pub(crate) const SCATTER: &str = "pass-01-scatter";
pub(crate) const GROUND: &str = "pass-02-ground";
pub(crate) const CLUSTER: &str = "pass-03-cluster";
pub(crate) const EXPORT: &str = "pass-04-export";

/// Raised when a method gives other results than before for the same input and settings.
const ALGORITHM_EPOCH: u32 = 1;

/// The survey depends on the files and on the raster.
pub(crate) fn survey(drive: &Drive, config: &Config) -> Inputs {
    let mut inputs = Inputs::new()
        .with("lattice.units_per_m", drive.lattice().units_per_m())
        .with("tiling.cell", config.tiling.cell)
        .with("input.unit", &config.input.unit);
    for file in drive.catalog.files() {
        let facts = format!("{} bytes, {} records", file.size_bytes(), file.point_count());
        inputs = inputs.with(format!("input {}", file.name()), facts);
    }
    inputs
}

/// Scattering depends on the content of the input and on the tiles.
pub(crate) fn scatter(scene: &Scene, plan: &Plan) -> Inputs {
    Inputs::new()
        .with("input content", format!("{:016x}", scene.content_digest()))
        .with("tiles", format!("{} tiles, geometry {:016x}", plan.tiles.len(), plan.digest()))
}

/// The ground pass depends on the content of the input, the tiles, and its own settings.
pub(crate) fn ground(scene: &Scene, plan: &Plan, config: &Config, chain: &Chain) -> Inputs {
    let inputs = Inputs::new()
        .with("algorithm epoch", ALGORITHM_EPOCH)
        .with("input content", format!("{:016x}", scene.content_digest()))
        .with("tiles", format!("{} tiles, geometry {:016x}", plan.tiles.len(), plan.digest()))
        .with("reach of ground and noise", format!("{} lattice units", chain.ground_reach))
        .with("ground.method", &config.ground.method);
    with_section(with_section(inputs, config, "noise"), config, &config.ground.method)
}

/// The cluster pass depends on the ground pass and its own settings.
pub(crate) fn cluster(ground: &Inputs, config: &Config) -> Inputs {
    let inputs = Inputs::new()
        .with("pass ground", ground.fingerprint())
        .with("cluster.method", &config.cluster.method);
    with_section(inputs, config, &config.cluster.method)
}

/// The export depends on the cluster pass, the axis (for chainage in the table) and the settings of the output.
pub(crate) fn export(cluster: &Inputs, scene: &Scene, config: &Config) -> Inputs {
    let inputs = Inputs::new().with("pass cluster", cluster.fingerprint()).with(
        "axis",
        format!("{:?}, {:.3} m, {:016x}", scene.axis.source, scene.axis.length_m(), scene.axis.digest()),
    );
    with_section(inputs, config, "output")
}
