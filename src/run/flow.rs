//! The flow of a run: survey, plan, passes over tiles, stitching, export; each step a pass and its reduction.

use crate::cluster::Method;
use crate::codec;
use crate::config::Config;
use crate::error::Result;
use crate::model::FieldSpace;
use crate::output::LabelledFile;
use crate::run::budget::Budget;
use crate::run::clustered::{Clustered, Objects};
use crate::run::drive::Drive;
use crate::run::engine::{CancelToken, Engine, PassFigures};
use crate::run::export_pass::ExportPass;
use crate::run::fields_pass::StoredFields;
use crate::run::finish::{self, Counts, Finished};
use crate::run::ground_pass::{GroundPass, GroundPayload};
use crate::run::methods::Chain;
use crate::run::observe::{Event, Observer};
use crate::run::prepare::{self, DriveEpsilon, Setting};
use crate::run::scatter_pass::{ScatterPass, Scattered};
use crate::run::scene::Scene;
use crate::run::street::Street;
use crate::run::survey_pass::SurveyPass;
use crate::run::tiles::Tiles;
use crate::run::{identity, inputs};
use crate::store::{Inputs, PassDir, RunDir};
use crate::survey::SurveyError;
use crate::tiling::{Plan, TileSize};

/// Records that tiles may read per point they need before the points are grouped by tile (architecture, section 3).
const LARGEST_AMPLIFICATION: f64 = 3.0;

/// What the tiles and files came to.
pub(crate) struct Outcome {
    pub(crate) counts: Counts,
    pub(crate) objects: usize,
    /// What is finished once the report is written; none when it had been before.
    pub(crate) unmarked: Option<(PassDir, Finished)>,
    /// What the clustering method has to say about its stages.
    pub(crate) stages: Option<serde_json::Value>,
    /// What was estimated for it.
    pub(crate) epsilon: Option<DriveEpsilon>,
}

/// What a method had to know of the whole drive.
struct Known {
    space: FieldSpace,
    fields: Option<StoredFields>,
    epsilon: Option<DriveEpsilon>,
}

/// A run under way.
pub(crate) struct Flow<'a> {
    pub(crate) engine: Engine<'a>,
    pub(crate) passes: Vec<PassFigures>,
    config: &'a Config,
    drive: &'a Drive,
    chain: &'a Chain,
    budget: Budget,
}

impl<'a> Flow<'a> {
    /// A flow in `run_dir`, with the threads and the memory that the settings ask for.
    pub(crate) fn new(
        run_dir: &'a RunDir,
        config: &'a Config,
        drive: &'a Drive,
        chain: &'a Chain,
        observer: &'a dyn Observer,
        cancel: &'a CancelToken,
    ) -> Self {
        let budget = Budget::resolve(&config.run);
        let engine = Engine {
            run_dir,
            threads: budget.threads,
            memory: budget.memory,
            fail_fast: config.run.fail_fast,
            observer,
            cancel,
        };
        Self { engine, passes: Vec::new(), config, drive, chain, budget }
    }

    fn pass_dir(&self, folder: &str, inputs: Inputs) -> PassDir {
        self.engine.run_dir.pass(folder, inputs)
    }

    /// Surveys the drive.
    pub(crate) fn survey(&mut self) -> Result<Scene> {
        if self.drive.catalog.point_count() == 0 {
            return Err(SurveyError::Empty { files: self.drive.catalog.files().len() }.into());
        }
        let dir = self.pass_dir(inputs::SURVEY, inputs::survey(self.drive, self.config));
        let pass = SurveyPass { drive: self.drive, runs: self.drive.block_runs() };
        identity::check_content(self.engine.run_dir, self.drive, &pass, &dir)?;
        self.passes.push(self.engine.execute(&pass, &dir)?);
        let scene = Scene::new(self.drive, pass.reduce(&dir)?, self.config)?;
        self.budget = self.budget.beside(scene.held_bytes());
        self.engine.memory = self.budget.memory;
        Ok(scene)
    }

    /// The plan of an earlier call if it still serves, else one that fits the budget.
    pub(crate) fn plan(&self, scene: &Scene) -> Result<Plan> {
        let street = Street::of(scene, self.drive);
        let stored: Option<TileSize> = self.engine.run_dir.read_json("plan.json")?;
        if let (Some(size @ TileSize::Equal { .. }), true) = (&stored, self.config.tiling.tile_length <= 0.0)
        {
            let plan = street.plan(size);
            if self.chain.largest_tile_bytes(&plan) <= self.budget.memory {
                return Ok(plan);
            }
        }
        let (size, plan) = street.fit(self.config, self.chain, &self.budget);
        if stored.as_ref() != Some(&size) {
            self.engine.run_dir.write_json("plan.json", &size)?;
        }
        let largest = self.chain.largest_tile_bytes(&plan);
        if largest > self.budget.memory {
            let text = format!(
                "the largest tile needs about {} MiB, the budget is {} MiB: it is processed alone",
                largest >> 20,
                self.budget.memory >> 20
            );
            self.engine.tell(&Event::Warning { text: &text });
        }
        Ok(plan)
    }

    /// The points grouped by tile, where tiles would read too many blocks in vain.
    fn scatter(&mut self, scene: &Scene, tiles: &Tiles<'_>) -> Result<Option<Scattered>> {
        let amplification = tiles.amplification(self.chain.ground_reach);
        if amplification <= LARGEST_AMPLIFICATION {
            return Ok(None);
        }
        let text = format!(
            "the order of the records would make tiles read {amplification:.1} times what they need: \
             the points are grouped by tile first"
        );
        self.engine.tell(&Event::Warning { text: &text });
        let pass = ScatterPass::new(self.drive, tiles.plan.owners(), self.engine.run_dir)?;
        let dir = self.pass_dir(inputs::SCATTER, inputs::scatter(scene, tiles.plan));
        pass.forget_lost(&dir)?;
        self.passes.push(self.engine.execute(&pass, &dir)?);
        Ok(Some(pass.reduce(&dir)?))
    }

    /// Tells ground and noise from objects: the finished pass, and the points of objects in the core of each tile.
    fn ground(&mut self, tiles: &Tiles<'_>, inputs: &Inputs) -> Result<(PassDir, Vec<u64>)> {
        let dir = self.pass_dir(inputs::GROUND, inputs.clone());
        let pass = GroundPass {
            tiles,
            noise: self.chain.noise.as_ref(),
            filter: &*self.chain.filter,
            reach: self.chain.ground_reach,
        };
        self.passes.push(self.engine.execute(&pass, &dir)?);
        let objects = pass.reduce(&dir)?;
        Ok((dir, objects))
    }

    /// What the method has to know of the whole drive, if anything, after the ground pass.
    fn know(&mut self, scene: &Scene, tiles: &Tiles<'_>, ground: &Inputs) -> Result<Option<Known>> {
        let Method::Prepared(method) = &self.chain.method else { return Ok(None) };
        let (needs, passes) = (method.needs(), &mut self.passes);
        let setting = Setting { engine: &self.engine, config: self.config, scene, ground };
        let (space, fields) = prepare::field_space(&setting, passes, tiles, needs)?;
        let mut epsilon = None;
        if needs.epsilon {
            let population = tiles.objects.iter().sum();
            let tiles = Tiles { fields: fields.as_ref(), ..*tiles };
            epsilon = Some(prepare::estimate(&setting, passes, &tiles, needs, &space, population)?);
        }
        Ok(Some(Known { space, fields, epsilon }))
    }

    /// Ground and epsilon, and nothing after that.
    pub(crate) fn estimate(&mut self, scene: &Scene, plan: &Plan) -> Result<Option<DriveEpsilon>> {
        let mut tiles = Tiles::of(self.drive, plan, scene);
        let scattered = self.scatter(scene, &tiles)?;
        tiles.scattered = scattered.as_ref();
        let ground = inputs::ground(scene, plan, self.config, self.chain);
        let (_, objects) = self.ground(&tiles, &ground)?;
        tiles.objects = &objects;
        Ok(self.know(scene, &tiles, &ground)?.and_then(|known| known.epsilon))
    }

    /// Ground, clusters, stitching, labelled files and tables.
    pub(crate) fn tiles_to_files(
        &mut self,
        scene: &Scene,
        plan: &Plan,
        labelled: Vec<LabelledFile>,
    ) -> Result<Outcome> {
        let mut tiles = Tiles::of(self.drive, plan, scene);
        let scattered = self.scatter(scene, &tiles)?;
        tiles.scattered = scattered.as_ref();
        let ground_inputs = inputs::ground(scene, plan, self.config, self.chain);
        let cluster_inputs = inputs::clusters(&ground_inputs, self.config, &self.chain.method);
        let export_inputs = inputs::export(&cluster_inputs, scene, self.config, &self.chain.method);
        let (ground_dir, objects) = self.ground(&tiles, &ground_inputs)?;
        tiles.objects = &objects;
        let known = self.know(scene, &tiles, &ground_inputs)?;
        tiles.fields = known.as_ref().and_then(|known| known.fields.as_ref());
        let folders: Vec<&str> = cluster_inputs.iter().map(|(folder, _)| folder.as_str()).collect();
        // Every method writes the labels of points to one place.
        self.engine.run_dir.keep_passes(inputs::CLUSTER, &folders)?;
        let cluster_dirs: Vec<PassDir> =
            cluster_inputs.into_iter().map(|(folder, inputs)| self.pass_dir(&folder, inputs)).collect();
        let export_dir = self.pass_dir(inputs::EXPORT, export_inputs);

        let ready = match (&self.chain.method, &known) {
            (Method::Prepared(method), Some(known)) => {
                Some(prepare::ready(&**method, &tiles, &known.space, known.epsilon.as_ref())?)
            }
            _ => None,
        };
        let (method, reach) = ready
            .as_ref()
            .map_or((&self.chain.method, self.chain.cluster_reach), |(method, reach)| (method, *reach));
        let epsilon = known.as_ref().and_then(|known| known.epsilon.clone());
        let clustered = Clustered::run(&self.engine, &mut self.passes, &tiles, method, reach, cluster_dirs)?;

        let payloads = (0..plan.tiles.len())
            .map(|tile| -> Result<GroundPayload> { codec::decode(&ground_dir.payload(tile)?) });
        let (grid, lattice) = (self.drive.grid, self.drive.lattice());
        let (counts, terrain) = finish::counts_and_terrain(payloads, grid, lattice, scene.lowest())?;
        if let Some(finished) = finish::already_finished(self.engine.run_dir, &export_dir)? {
            return Ok(Outcome { counts, objects: finished.objects, unmarked: None, stages: None, epsilon });
        }
        let started = std::time::Instant::now();
        let Objects { stitched, figures, charts } = clustered.objects()?;
        self.passes.push(PassFigures {
            pass: "stitch",
            units: plan.tiles.len(),
            resumed: 0,
            points: 0,
            seconds: started.elapsed().as_secs_f64(),
        });
        finish::withdraw(self.engine.run_dir, &export_dir)?;
        let export =
            ExportPass::new(self.drive, plan.owners(), &stitched.ids, labelled, self.engine.run_dir)?;
        export.begin(&export_dir, self.engine.run_dir)?;
        self.passes.push(self.engine.execute(&export, &export_dir)?);
        export.reduce(&export_dir, self.engine.run_dir)?;
        finish::write_tables(self.engine.run_dir, self.drive, scene, &stitched, &terrain)?;
        finish::write_charts(self.engine.run_dir, &charts)?;
        let objects = stitched.objects.len();
        let unmarked = Some((export_dir, Finished { objects, files: export.names() }));
        Ok(Outcome { counts, objects, unmarked, stages: figures, epsilon })
    }
}
