//! The steps of any clustering method. Each step is a pass over the tiles with a reduction, and is repeated
//! until it has settled if it asks for this. The last step labels points, and its reduction is the pass
//! `stitch`.

use xxhash_rust::xxh3::xxh3_64;

use crate::cluster::{BytesPer, DriveWindow, Labelled, Mapped, Method, Reduced, Repeat, TilePoints};
use crate::codec;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::model::{ObjectPart, PointId, TileId};
use crate::run::chain::with_section;
use crate::run::drive::Classified;
use crate::run::engine::{Driver, Outline, Pass, Payloads, Rounds, prefix};
use crate::run::error::RunError;
use crate::run::passes::sections;
use crate::run::passes::window::{Around, MethodDrive, Progress, StepResults};
use crate::stitch::{LocalLabels, LocalObject};
use crate::store::{Inputs, RunDir};

const NUMBER: u32 = 3;

/// The outlines of the steps of a method. The first step depends on the pass `ground`, each later step on the
/// previous one, and each step on its own settings.
pub(crate) fn outlines(ground: &Outline, config: &Config, method: &dyn Method) -> Vec<Outline> {
    let mut outlines: Vec<Outline> = Vec::new();
    for (number, step) in method.steps().iter().enumerate() {
        let mut depends = match outlines.last() {
            Some(before) => Inputs::new().with("pass before", before.depends.fingerprint()),
            None => Inputs::new()
                .with("pass ground", ground.depends.fingerprint())
                .with("cluster.method", &config.cluster.method),
        };
        for key in step.settings {
            depends = with_setting(depends, config, key);
        }
        for (name, value) in method.depends_on(number) {
            depends = depends.with(name, value);
        }
        outlines.push(Outline::of_step(NUMBER, number, step.name, depends));
    }
    outlines
}

/// Adds a setting (`section.key`), or a whole section (`section.*`), to the values that a pass depends on.
fn with_setting(depends: Inputs, config: &Config, key: &str) -> Inputs {
    // A word without a key is a section, so that a dependency is never silently left out.
    let (section, name) = key.split_once('.').unwrap_or((key, "*"));
    if name == "*" {
        return with_section(depends, config, section);
    }
    let value = config.method_table(section).get(name).map(ToString::to_string);
    depends.with(key, value.unwrap_or_else(|| "default".to_owned()))
}

/// One round of one step.
struct StepPass<'a> {
    progress: &'a Progress<'a>,
    step: usize,
    /// Distance around a tile within which the step reads points, in lattice units.
    reach: i64,
    outline: Outline,
}

impl StepPass<'_> {
    fn tile(&self, unit: usize) -> usize {
        self.progress.current.rounds.due()[unit]
    }

    fn classified(&self) -> &Classified<'_> {
        self.progress.over.classified
    }

    /// The objects of a tile, and the label of each point of objects in its core.
    fn keep(&self, tile: TileId, labelled: Labelled) -> Result<(LocalLabels, Vec<u32>)> {
        let Labelled { points: TilePoints { cloud, core, ground }, mut labels, count, with_halo } = labelled;
        let drive = self.classified().tiled.drive;
        let plan = self.progress.plan();
        let file = |id: PointId| drive.file_of(id);
        let local = if with_halo {
            let owners = plan.owners();
            let owner = |point: usize| {
                let [x, y, _] = cloud.lattice_point(point);
                // Gathered points lie in occupied cells, and these have an owner.
                TileId::new(drive.grid.cell(x, y).map_or(0, |cell| owners.get(cell)).saturating_sub(1))
            };
            let size = self.progress.over.method.object_size();
            LocalLabels::collect(&cloud, &core, &mut labels, count, &size, owner, file)
        } else {
            let parts = ObjectPart::collect(&cloud, &labels, count, |point| core[point], file);
            let objects = parts.into_iter().map(|part| LocalObject { open: true, part }).collect();
            LocalLabels { objects, seams: Vec::new() }
        };
        let of_objects = |point: &usize| core[*point] && !ground.get(*point).copied().unwrap_or(false);
        let kept: Vec<u32> = (0..cloud.len()).filter(of_objects).map(|point| labels[point]).collect();
        let expected = self.classified().objects[tile.index()];
        if kept.len() as u64 != expected {
            let text = format!("tile {tile} has {expected} points of objects, and labels for {}", kept.len());
            return Err(Error::bug(text));
        }
        Ok((local, kept))
    }
}

impl Pass for StepPass<'_> {
    type Global = Payloads;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.progress.current.rounds.due().len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.progress.plan().tiles[self.tile(unit)].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        let tile = self.tile(unit);
        match self.progress.over.method.steps()[self.step].bytes {
            BytesPer::Point(bytes) => self.progress.plan().region_points(tile, self.reach) * bytes,
            BytesPer::ObjectPoint(bytes) => self.classified().object_points(tile, self.reach) * bytes,
        }
    }

    fn prefetch(&self, unit: usize) {
        self.classified().tiled.prefetch(self.tile(unit), self.reach);
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let tile = TileId::at(self.tile(unit));
        let around = Around { progress: self.progress, tile };
        let Mapped { payload, border, labelled } = self.progress.over.method.map(self.step, &around)?;
        let mut objects = Vec::new();
        let mut labels = Vec::new();
        if let Some(labelled) = labelled {
            let (local, kept) = self.keep(tile, labelled)?;
            objects = codec::encode(&local)?;
            labels = kept.iter().flat_map(|label| label.to_le_bytes()).collect();
        }
        Ok(codec::pack(&[payload, border, objects, labels]))
    }

    fn reduce(&self, payloads: &Payloads) -> Result<Payloads> {
        Ok(payloads.clone())
    }
}

/// Removes the results of the steps of other methods. They are not used here and take space.
pub(crate) fn remove_others(run_dir: &RunDir, outlines: &[Outline]) -> Result<()> {
    let ours = |name: &str| outlines.iter().any(|outline| outline.owns(name));
    Ok(run_dir.remove_passes(&prefix(NUMBER), ours)?)
}

/// Completes the steps of a method up to and including step `last`. `None` if the driver does not compute
/// missing units. The last step of the method is not reduced.
pub(crate) fn complete<'a, D: Driver>(
    driver: &mut D,
    over: &'a MethodDrive<'a>,
    outlines: &[Outline],
    last: usize,
) -> Result<Option<Progress<'a>>> {
    let mut progress = Progress { over, done: Vec::new(), current: begin(over), again: Vec::new() };
    for (step, outline) in outlines.iter().enumerate().take(last + 1) {
        if !complete_step(driver, &mut progress, step, outline)? {
            return Ok(None);
        }
    }
    Ok(Some(progress))
}

fn begin(over: &MethodDrive<'_>) -> StepResults {
    StepResults { rounds: Rounds::new(over.classified.tiled.count(), xxh3_64(&[])), payloads: Vec::new() }
}

/// Completes a step in as many rounds as necessary. `false` if the driver does not compute missing units.
fn complete_step<D: Driver>(
    driver: &mut D,
    progress: &mut Progress<'_>,
    step: usize,
    outline: &Outline,
) -> Result<bool> {
    let method = progress.over.method;
    let most = match method.steps()[step].repeat {
        Repeat::Once => 1,
        Repeat::UntilSettled { most } => most,
    };
    loop {
        let round = progress.current.rounds.round();
        let outline = outline.round(round);
        let reach = method.reach(step, progress)?;
        let pass = StepPass { progress, step, reach, outline: outline.clone() };
        let units = pass.units();
        let Some(payloads) = driver.complete(&pass)? else { return Ok(false) };
        let due = complete_round(progress, step, payloads.clone())?;
        let next = if due.is_empty() {
            if step + 1 == method.steps().len() {
                return Ok(true);
            }
            match reduce(driver, progress, step, &payloads, units)? {
                Step::Complete(global) => {
                    let next = begin(progress.over);
                    progress.done.push((std::mem::replace(&mut progress.current, next), global));
                    progress.again.clear();
                    return Ok(true);
                }
                Step::Again(bytes) => {
                    progress.again = bytes;
                    None
                }
            }
        } else {
            Some(due)
        };
        if round + 1 >= most {
            let tiles = next.map_or(progress.tiles(), |due| due.len());
            return Err(RunError::NotSettled { pass: outline.name.to_owned(), rounds: most, tiles }.into());
        }
        match next {
            Some(due) => progress.current.rounds.next(due),
            None => progress.current.rounds.again(),
        }
    }
}

/// Reads the payloads of a round, and returns the tiles that must run again because they see a changed
/// border.
fn complete_round(progress: &mut Progress<'_>, step: usize, payloads: Payloads) -> Result<Vec<usize>> {
    let method = progress.over.method;
    if method.steps()[step].repeat == Repeat::Once {
        progress.current.payloads.push(payloads);
        let none = vec![xxh3_64(&[]); progress.tiles()];
        return Ok(progress.current.rounds.complete(&none, |_| Vec::new()));
    }
    let mut borders = Vec::new();
    for unit in 0..progress.current.rounds.due().len() {
        borders.push(xxh3_64(&payloads.reader(unit)?.read_section(sections::BORDER)?));
    }
    progress.current.payloads.push(payloads);
    let reach = method.border_reach(step, progress.lattice());
    let plan = progress.over.classified.tiled.plan;
    let sees = |tile: usize| {
        let near = plan.region(tile, reach).tiles;
        near.into_iter().map(TileId::index).filter(|other| *other != tile).collect()
    };
    Ok(progress.current.rounds.complete(&borders, sees))
}

/// The outcome of a reduction.
enum Step {
    Complete(Vec<u8>),
    Again(Vec<u8>),
}

/// The reduction of a step that is not the last. It is read from the store, where it follows the units of its
/// round, or else computed and stored there.
fn reduce<D: Driver>(
    driver: &D,
    progress: &Progress<'_>,
    step: usize,
    payloads: &Payloads,
    units: usize,
) -> Result<Step> {
    let dir = payloads.dir()?;
    let (again, bytes) = match dir.load(units)? {
        Ok(stored) => codec::decode::<(bool, Vec<u8>)>(&stored)?,
        Err(_) => {
            let reduced = match progress.over.method.reduce(step, progress)? {
                Reduced::Global(bytes) => (false, bytes),
                Reduced::Again(bytes) => (true, bytes),
                other => {
                    return Err(Error::bug(format!("step {step} is not the last, and returned {other:?}")));
                }
            };
            if driver.computes() {
                dir.commit(units, &codec::encode(&reduced)?)?;
            }
            reduced
        }
    };
    Ok(if again { Step::Again(bytes) } else { Step::Complete(bytes) })
}
