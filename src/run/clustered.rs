//! Clustering as the flow sees it, whether the method takes one pass or several.

use crate::cluster::{Method, StagedClusterer};
use crate::error::Result;
use crate::model::Chart;
use crate::run::cluster_pass::ClusterPass;
use crate::run::engine::{Engine, PassFigures};
use crate::run::staged_pass::{Done, StagedPass};
use crate::run::tiles::Tiles;
use crate::stitch::Stitched;
use crate::store::PassDir;

/// The finished passes of a clustering method.
pub(crate) enum Clustered<'a> {
    Local(ClusterPass<'a>, PassDir),
    Staged(Done<'a>, &'a dyn StagedClusterer),
}

impl<'a> Clustered<'a> {
    /// Runs the passes of `method`, one per folder of `dirs`, with their reductions.
    pub(crate) fn run(
        engine: &Engine<'_>,
        passes: &mut Vec<PassFigures>,
        tiles: &'a Tiles<'a>,
        method: &'a Method,
        reach: i64,
        dirs: Vec<PassDir>,
    ) -> Result<Self> {
        match method {
            Method::Local(method) => {
                let pass = ClusterPass { tiles, method: &**method, reach };
                let mut dirs = dirs.into_iter();
                let dir =
                    dirs.next().ok_or_else(|| crate::Error::bug("no folder for the clusters".to_owned()))?;
                passes.push(engine.execute(&pass, &dir)?);
                Ok(Self::Local(pass, dir))
            }
            Method::Staged(method) => {
                let method = &**method;
                let mut done = Done::new(tiles);
                let last = method.stages().len() - 1;
                for (stage, dir) in dirs.into_iter().enumerate() {
                    passes.push(engine.execute(&StagedPass { done: &done, method, stage, reach }, &dir)?);
                    done.dirs.push(dir);
                    if stage < last {
                        done.reduce(method)?;
                    }
                }
                Ok(Self::Staged(done, method))
            }
            Method::Prepared(method) => Err(crate::Error::bug(format!("{} was not prepared", method.name()))),
        }
    }

    /// Whole objects and their ids.
    pub(crate) fn objects(&self) -> Result<Objects> {
        match self {
            Self::Local(pass, dir) => {
                Ok(Objects { stitched: pass.reduce(dir)?, figures: None, charts: Vec::new() })
            }
            Self::Staged(done, method) => done.objects(*method),
        }
    }
}

/// Whole objects, and what the method has to say about them.
pub(crate) struct Objects {
    pub(crate) stitched: Stitched,
    /// Figures of its stages, if it has any.
    pub(crate) figures: Option<serde_json::Value>,
    pub(crate) charts: Vec<Chart>,
}
