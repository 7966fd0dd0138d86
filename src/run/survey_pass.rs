//! Pass `survey`: streams through every block once; keeps the zone map, the occupancy raster and the time bins.

use crate::codec;
use crate::error::Result;
use crate::run::drive::{BlockRun, Drive};
use crate::run::engine::Pass;
use crate::store::PassDir;
use crate::survey::{Collector, Survey, SurveyPart};

pub(crate) struct SurveyPass<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) runs: Vec<BlockRun>,
}

impl Pass for SurveyPass<'_> {
    fn name(&self) -> &'static str {
        "survey"
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

    fn prefetch(&self, unit: usize) {
        let run = &self.runs[unit];
        run.blocks.clone().for_each(|block| self.drive.file(run.file).prefetch(block));
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        codec::encode(&self.survey(unit, true)?)
    }

    fn sync(&self) -> Result<()> {
        self.drive.sync_positions()
    }
}

impl SurveyPass<'_> {
    /// Surveys a unit; with `unpack` it also leaves the positions of a compressed file in their column.
    pub(crate) fn survey(&self, unit: usize, unpack: bool) -> Result<SurveyPart> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let mut collector = Collector::new(self.drive.grid);
        let mut buffer = Vec::new();
        for block in run.blocks.clone() {
            self.drive.survey_block((run.file, block), unpack, &mut buffer, &mut collector)?;
        }
        Ok(collector.finish())
    }

    /// The survey of the whole drive, from the finished pass.
    pub(crate) fn reduce(&self, dir: &PassDir) -> Result<Survey> {
        let mut survey = Survey::default();
        for (unit, run) in self.runs.iter().enumerate() {
            survey.add(run.file, codec::decode(&dir.payload(unit)?)?);
        }
        Ok(survey)
    }
}
