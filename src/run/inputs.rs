//! What each pass depends on, by name: the lists behind fingerprints and behind `status --why`.

use crate::cluster::{EpsilonConfig, Method, Needs};
use crate::config::Config;
use crate::model::Field;
use crate::run::drive::Drive;
use crate::run::methods::{Chain, with_section};
use crate::run::scene::Scene;
use crate::store::Inputs;
use crate::tiling::Plan;

pub(crate) const SURVEY: &str = "pass-00-survey";
pub(crate) const SCATTER: &str = "pass-01-scatter";
pub(crate) const FIELDS: &str = "pass-01-fields";
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
        .with("input.unit", config.input.unit.name());
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

/// The pass over fields depends on the content of the input and on which fields they are.
pub(crate) fn fields(scene: &Scene, fields: &[Field]) -> Inputs {
    let names: Vec<&str> = fields.iter().map(|field| field.name()).collect();
    Inputs::new()
        .with("algorithm epoch", ALGORITHM_EPOCH)
        .with("input content", format!("{:016x}", scene.content_digest()))
        .with("fields", names.join(" "))
}

/// The curve over K neighbours depends on the ground pass, the fields, and on which points are asked; every K has a folder of
/// its own.
pub(crate) fn epsilon(
    ground: &Inputs,
    needs: &Needs,
    settings: &EpsilonConfig,
    k: usize,
) -> (String, Inputs) {
    let names: Vec<&str> = needs.fields.iter().map(|field| field.name()).collect();
    let inputs = Inputs::new()
        .with("pass ground", ground.fingerprint())
        .with("fields", names.join(" "))
        .with("weights", format!("{:?}", needs.weights))
        .with("epsilon.max_queries", settings.max_queries)
        .with("epsilon.seed", settings.seed);
    (format!("pass-02-epsilon-{k}"), inputs)
}

/// The folder of each pass of the clustering method and what it depends on: one pass on the ground pass and all
/// settings, stages on what is before them and their own settings.
pub(crate) fn clusters(ground: &Inputs, config: &Config, method: &Method) -> Vec<(String, Inputs)> {
    let after = |inputs: &Inputs| Inputs::new().with("pass before", inputs.fingerprint());
    match method {
        Method::Local(_) | Method::Prepared(_) => {
            let inputs = Inputs::new()
                .with("pass ground", ground.fingerprint())
                .with("cluster.method", &config.cluster.method);
            let mut inputs = with_section(inputs, config, &config.cluster.method);
            if matches!(method, Method::Prepared(method) if method.needs().epsilon) {
                inputs = with_section(inputs, config, "epsilon");
            }
            vec![(CLUSTER.to_owned(), inputs)]
        }
        Method::Staged(method) => {
            let settings = config.method_table(method.name());
            let mut passes: Vec<(String, Inputs)> = Vec::new();
            for (number, stage) in (1..).zip(method.stages()) {
                let mut inputs = match passes.last() {
                    Some((_, before)) => after(before),
                    None => after(ground).with("cluster.method", &config.cluster.method),
                };
                for key in stage.settings {
                    let value = settings.get(*key).map_or_else(|| "default".to_owned(), ToString::to_string);
                    inputs = inputs.with(format!("{}.{key}", method.name()), value);
                }
                passes.push((format!("{CLUSTER}-{number}-{}", stage.name), inputs));
            }
            passes
        }
    }
}

/// The export depends on the passes of the clustering method and its settings (of stages, the reduction of the last
/// one may use some that no pass depends on), the axis (for chainage in the table) and the settings of the output.
pub(crate) fn export(
    clusters: &[(String, Inputs)],
    scene: &Scene,
    config: &Config,
    method: &Method,
) -> Inputs {
    let before = clusters.last().map_or_else(String::new, |(_, inputs)| inputs.fingerprint().to_string());
    let mut inputs = Inputs::new().with("pass cluster", before).with(
        "axis",
        format!("{:?}, {:.3} m, {:016x}", scene.axis.source, scene.axis.length_m(), scene.axis.digest()),
    );
    if let Method::Staged(method) = method {
        inputs = with_section(inputs, config, method.name());
    }
    with_section(inputs, config, "output")
}
