//! Pass `survey`: reads every record once. Its reduction gives the facts of the whole drive.
//!
//! ```text
//! payload := part positions withheld     sections; of compressed files only: positions (x y z, i32, as in
//!                                        the record), and u8 per record if any is withheld
//! ```

use crate::codec;
use crate::config::Config;
use crate::error::Result;
use crate::run::drive::{BlockRun, Drive, Positions, Unpacked, identity};
use crate::run::engine::{Outline, Pass, Payloads};
use crate::store::{Inputs, PassDir, RunDir};
use crate::survey::{Collector, Survey, SurveyPart};

const NUMBER: u32 = 0;
const NAME: &str = "survey";

/// What the bytes of a unit mean. 2: bins of time have the extent of their points. 3: withheld points count
/// by themselves.
const EPOCH: u32 = 3;

/// Sections of the payload of a unit.
const PART: usize = 0;
const POSITIONS: usize = 1;
const WITHHELD: usize = 2;

pub(crate) struct SurveyPass<'a> {
    drive: &'a Drive,
    /// `None` if nothing is stored.
    run_dir: Option<&'a RunDir>,
    runs: Vec<BlockRun>,
    outline: Outline,
}

impl<'a> SurveyPass<'a> {
    /// The survey of a drive. It depends on the files and on the raster.
    pub(crate) fn of(drive: &'a Drive, config: &Config, run_dir: Option<&'a RunDir>) -> Self {
        let mut depends = Inputs::new()
            .with("survey epoch", EPOCH)
            .with("lattice.units_per_m", drive.lattice().units_per_m())
            .with("tiling.cell", config.tiling.cell)
            .with("input.unit", config.input.unit.name())
            .with("units of coordinates in metres", format!("{:?}", drive.catalog.units_m()));
        for file in drive.catalog.files() {
            let facts = format!("{} bytes, {} records", file.size_bytes(), file.point_count());
            depends = depends.with(format!("input {}", file.name()), facts);
        }
        Self { drive, run_dir, runs: drive.block_runs(), outline: Outline::new(NUMBER, NAME, depends) }
    }

    /// For files that were touched since the survey, compares their content with the content at the survey,
    /// before anything of a run is recorded.
    pub(crate) fn check_content(&self) -> Result<()> {
        let Some(run_dir) = self.run_dir else { return Ok(()) };
        self.verify(&run_dir.pass(&self.outline.folder, self.outline.depends.clone()))
    }

    /// Surveys a unit. With `unpack` it also returns the records of a compressed file.
    fn survey(&self, unit: usize, unpack: bool) -> Result<(SurveyPart, Unpacked)> {
        let run = &self.runs[unit];
        let file = self.drive.file(run.file);
        file.check_unchanged()?;
        let mut collector = Collector::new(self.drive.grid, self.drive.lattice());
        let mut buffer = Vec::new();
        let mut records = Unpacked::default();
        for block in run.blocks.clone() {
            let unpacked = (unpack && file.is_compressed()).then_some(&mut records);
            self.drive.survey_block((run.file, block), unpacked, &mut buffer, &mut collector)?;
        }
        let part = collector.finish();
        if part.withheld.is_empty() {
            records.withheld.clear();
        }
        Ok((part, records))
    }

    /// The positions of compressed files, from the units of the complete pass. `None` if there are none.
    /// `withheld` says which units have withheld records.
    fn positions(&self, payloads: &Payloads, withheld: &[bool]) -> Option<Positions> {
        let any = self.drive.catalog.files().iter().any(|file| file.is_compressed());
        (any && self.run_dir.is_some()).then(|| Positions {
            positions: self.drive.per_point(&self.runs, payloads, POSITIONS),
            withheld: self.drive.per_point_of(&self.runs, payloads, WITHHELD, withheld),
        })
    }
}

impl Pass for SurveyPass<'_> {
    type Global = Survey;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.runs.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.runs[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        // Positions of a block on the lattice, the counts, and the positions and flags of the unit, which are
        // in memory twice while the unit is stored.
        let run = &self.runs[unit];
        let unpacked = if self.drive.file(run.file).is_compressed() { run.points * 26 } else { 0 };
        self.drive.largest_block_bytes(run, 12) + unpacked + (16 << 20)
    }

    fn prepare(&self, dir: &PassDir) -> Result<()> {
        self.verify(dir)
    }

    /// For files that were touched since the survey, compares their content with the content at the survey.
    fn verify(&self, dir: &PassDir) -> Result<()> {
        let Some(run_dir) = self.run_dir else { return Ok(()) };
        // Without unpacking: the positions from the input at the start of the run must stay.
        let stored = |unit| codec::decode(&dir.reader(unit)?.read_section(PART)?);
        let survey = |unit| self.survey(unit, false).map(|(part, _)| part);
        identity::check_content(run_dir, self.drive, dir, &self.runs, &stored, &survey)
    }

    fn prefetch(&self, unit: usize) {
        let run = &self.runs[unit];
        run.blocks.clone().for_each(|block| self.drive.file(run.file).prefetch(block));
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let (part, records) = self.survey(unit, self.run_dir.is_some())?;
        let positions = bytemuck::cast_slice(&records.positions);
        Ok(codec::pack(&[&codec::encode(&part)?[..], positions, &records.withheld]))
    }

    /// The survey of the whole drive. From then on the positions of compressed files are read from the units.
    fn reduce(&self, payloads: &Payloads) -> Result<Survey> {
        let mut survey = Survey::default();
        let mut withheld = Vec::with_capacity(self.runs.len());
        for (unit, run) in self.runs.iter().enumerate() {
            let part: SurveyPart = codec::decode(&payloads.section(unit, PART)?)?;
            withheld.push(!part.withheld.is_empty());
            survey.add(run.file, part);
        }
        if let Some(positions) = self.positions(payloads, &withheld) {
            self.drive.use_positions(positions);
        }
        Ok(survey)
    }
}
