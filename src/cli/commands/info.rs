//! `chainage info`.

use chainage::input::unit_symbol;
use chainage::run::{DriveFacts, look_at};

use crate::cli::drive_args::{Inputs, LookSettings};
use crate::cli::exit::Outcome;
use crate::cli::print::JsonOutput;
use crate::cli::{exit, print};

#[derive(Debug, clap::Args)]
pub(crate) struct InfoArgs {
    #[command(flatten)]
    inputs: Inputs,
    #[command(flatten)]
    json: JsonOutput,
    #[command(flatten)]
    settings: LookSettings,
}

impl InfoArgs {
    pub(crate) fn run(&self) -> Outcome {
        let config = self.settings.resolve()?;
        let facts = look_at(&self.inputs.files()?, &config)?;
        self.json.show(&facts, || page(&facts))?;
        Ok(exit::DONE)
    }
}

fn page(facts: &DriveFacts) -> String {
    let rows: Vec<Vec<String>> = facts
        .files
        .iter()
        .map(|file| {
            let kind = if file.copc {
                "COPC"
            } else if file.compressed {
                "LAZ"
            } else {
                "LAS"
            };
            vec![
                file.name.clone(),
                format!("{kind} {}", file.version),
                file.point_format.to_string(),
                print::count(file.points),
                print::bytes(file.bytes),
                file.dimensions.join(" "),
            ]
        })
        .collect();
    let mut text = print::table(&["file", "version", "format", "points", "size", "extra dimensions"], &rows);
    let span = |axis: usize| facts.max_m[axis] - facts.min_m[axis];
    let withheld = match facts.withheld {
        0 => String::new(),
        points => format!(" ({} withheld)", print::count(points)),
    };
    text.push_str(&format!(
        "\n  points    {}{withheld} in {}, {}\n",
        print::count(facts.points),
        print::counted(facts.files.len() as u64, "file"),
        print::bytes(facts.bytes)
    ));
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        // Coordinates are shown in the unit of the files, as in every other program.
        let unit_m = facts.units_m[axis];
        let unit = unit_symbol(unit_m);
        let (low, high) = (facts.min_m[axis] / unit_m, facts.max_m[axis] / unit_m);
        text.push_str(&format!("  {name}         {low:.3} to {high:.3} {unit} ({:.1} m)\n", span(axis)));
    }
    text.push_str(&format!(
        "  density   {:.0} points/m² on {:.0} occupied m²; median {:.0}, densest {:.0}\n",
        facts.density_mean, facts.area_m2, facts.density_median, facts.density_max
    ));
    if let Some((first, last)) = facts.gps_time_s {
        text.push_str(&format!("  GPS time  {first:.3} to {last:.3} s ({:.1} s)\n", last - first));
    } else {
        text.push_str("  GPS time  none\n");
    }
    text.push_str(&format!("  CRS       {}\n", facts.crs));
    text.push_str(&format!("  axis      {:.0} m, {}\n", facts.axis.length_m, axis_source(&facts.axis)));
    text.push_str(&print::warnings(&facts.warnings));
    text
}

/// Where an axis came from, in words.
pub(crate) fn axis_source(axis: &chainage::run::AxisFacts) -> String {
    use chainage::survey::AxisSource;
    let source = match axis.source {
        AxisSource::Trajectory => "from the trajectory",
        AxisSource::GpsTime => "from GPS time",
        AxisSource::Principal => "principal axis of the points",
    };
    if axis.stretches > 1 { format!("{source}, in {} parts", axis.stretches) } else { source.to_owned() }
}
