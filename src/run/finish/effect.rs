//! Settings and outputs that have no effect on what a run writes.

use crate::cluster::Method;
use crate::config::{ClassificationChoice, Config, ConfigError};

/// A warning about each of them.
pub(crate) fn warnings(config: &Config, method: &dyn Method) -> Result<Vec<String>, ConfigError> {
    let output = &config.output;
    let name = method.name();
    let is_named = |wanted: &str| output.files.iter().any(|file| file == wanted);
    let mut warnings = Vec::new();
    if is_named("ply") && !method.finds_surfaces() {
        warnings.push(format!("the output ply needs surfaces, and {name} finds none: it is not written"));
    }
    if is_named("charts") && method.charts().is_empty() {
        warnings.push(format!("the output charts has no effect: {name} draws none"));
    }
    if is_named("report") && !output.writes("report") {
        warnings.push("the output report has no effect: output.report is false (--no-report)".to_owned());
    }
    let chose_codes = matches!(&output.classification, ClassificationChoice::Set(codes) if !codes.is_empty());
    if chose_codes && !method.classifies() {
        warnings
            .push(format!("the LAS codes of output.classification have no effect: {name} names no objects"));
    }
    for line in config.differences()? {
        let reason = match line.split(" = ").next() {
            Some("output.format" | "output.original_classification") if !output.writes("points") => {
                "no labelled copies are written (points is not among output.files)"
            }
            Some("output.dimension" | "output.classification")
                if !output.writes("points") && !output.writes("copc") =>
            {
                "no points are written (neither points nor copc is among output.files)"
            }
            Some("output.report_mb") if !output.writes("report") => "report.html is not written",
            _ => continue,
        };
        warnings.push(format!("{line} has no effect: {reason}"));
    }
    Ok(warnings)
}
