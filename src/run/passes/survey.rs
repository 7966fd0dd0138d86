//! Pass `survey`: reads every record once; and its reduction, what is known of the drive as a whole.

use crate::codec;
use crate::config::Config;
use crate::error::Result;
use crate::run::drive::{BlockRun, Drive, identity};
use crate::run::engine::{Outline, Pass, Payloads};
use crate::store::{Inputs, PassDir, RunDir};
use crate::survey::{Collector, Survey, SurveyPart};

const NUMBER: u32 = 0;
const NAME: &str = "survey";

pub(crate) struct SurveyPass<'a> {
    drive: &'a Drive,
    /// Where positions of compressed files go; none where nothing is kept.
    run_dir: Option<&'a RunDir>,
    runs: Vec<BlockRun>,
    outline: Outline,
}

/// Folder of the pass.
pub(crate) fn folder() -> String {
    Outline::new(NUMBER, NAME, Inputs::new()).folder
}

impl<'a> SurveyPass<'a> {
    /// The survey of a drive. It depends on the files and on the raster.
    pub(crate) fn of(drive: &'a Drive, config: &Config, run_dir: Option<&'a RunDir>) -> Self {
        let mut depends = Inputs::new()
            .with("lattice.units_per_m", drive.lattice().units_per_m())
            .with("tiling.cell", config.tiling.cell)
            .with("input.unit", config.input.unit.name());
        for file in drive.catalog.files() {
            let facts = format!("{} bytes, {} records", file.size_bytes(), file.point_count());
            depends = depends.with(format!("input {}", file.name()), facts);
        }
        Self { drive, run_dir, runs: drive.block_runs(), outline: Outline::new(NUMBER, NAME, depends) }
    }

    /// Surveys a unit; with `unpack` it also leaves the positions of a compressed file in their column.
    fn survey(&self, unit: usize, unpack: bool) -> Result<SurveyPart> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let mut collector = Collector::new(self.drive.grid);
        let mut buffer = Vec::new();
        for block in run.blocks.clone() {
            self.drive.survey_block((run.file, block), unpack, &mut buffer, &mut collector)?;
        }
        Ok(collector.finish())
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
        // Positions, as stored and on the lattice, and what is counted.
        self.drive.largest_block_bytes(&self.runs[unit], 24) + (16 << 20)
    }

    /// Compares the content of files that were touched since with what was surveyed.
    fn prepare(&self, dir: &PassDir) -> Result<()> {
        let Some(run_dir) = self.run_dir else { return Ok(()) };
        // Without unpacking: positions of the input that the run was started with must stay.
        identity::check_content(run_dir, self.drive, dir, &self.runs, &|unit| self.survey(unit, false))
    }

    fn prefetch(&self, unit: usize) {
        let run = &self.runs[unit];
        run.blocks.clone().for_each(|block| self.drive.file(run.file).prefetch(block));
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        codec::encode(&self.survey(unit, self.run_dir.is_some())?)
    }

    fn sync(&self) -> Result<()> {
        self.drive.sync_positions()
    }

    /// The survey of the whole drive.
    fn reduce(&self, payloads: &Payloads) -> Result<Survey> {
        let mut survey = Survey::default();
        for (unit, run) in self.runs.iter().enumerate() {
            survey.add(run.file, codec::decode(&payloads.get(unit)?)?);
        }
        Ok(survey)
    }
}
