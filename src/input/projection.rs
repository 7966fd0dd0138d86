//! The projection of a well-known text as numbers, to compare systems that have no code. Names of methods
//! and parameters differ between the two versions of the text and between programs; numbers do not.

use super::wkt::{self, Node};

/// The well-known text (version 1) of a code in the EPSG dataset.
pub(super) fn definition(code: u32) -> Option<&'static str> {
    Some(crs_definitions::from_code(u16::try_from(code).ok()?)?.wkt)
}

/// A text without the codes of the whole system and of its projected part. Other programs look up these codes
/// before they read the rest.
pub(super) fn without_codes(text: String) -> String {
    let Some(root) = Node::parse(&text) else { return text };
    let codes: Vec<u32> =
        [Some(&root), projected(&root)].into_iter().flatten().filter_map(Node::epsg).collect();
    if codes.is_empty() { text } else { wkt::without_codes(&text, &codes) }
}

/// A parameter of a projection, or of its ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Parameter {
    Latitude,
    Longitude,
    FirstParallel,
    SecondParallel,
    Azimuth,
    SkewAngle,
    Scale,
    Easting,
    Northing,
    SemiMajorAxis,
}

/// Parameters by their names in both versions of the text, without spaces, underscores and capitals.
const PARAMETERS: [(Parameter, &[&str]); 9] = [
    (
        Parameter::Latitude,
        &[
            "latitudeoforigin",
            "latitudeofcenter",
            "latitudeofcentre",
            "latitudeofnaturalorigin",
            "latitudeoffalseorigin",
            "latitudeofprojectioncentre",
        ],
    ),
    (
        Parameter::Longitude,
        &[
            "centralmeridian",
            "longitudeoforigin",
            "longitudeofcenter",
            "longitudeofcentre",
            "longitudeofnaturalorigin",
            "longitudeoffalseorigin",
            "longitudeofprojectioncentre",
        ],
    ),
    (Parameter::FirstParallel, &["standardparallel1", "latitudeof1ststandardparallel"]),
    (Parameter::SecondParallel, &["standardparallel2", "latitudeof2ndstandardparallel"]),
    (Parameter::Azimuth, &["azimuth", "azimuthofinitialline", "azimuthatprojectioncentre"]),
    (Parameter::SkewAngle, &["rectifiedgridangle", "anglefromrectifiedtoskewgrid"]),
    (
        Parameter::Scale,
        &[
            "scalefactor",
            "scalefactoratnaturalorigin",
            "scalefactoroninitialline",
            "scalefactoratprojectioncentre",
        ],
    ),
    (Parameter::Easting, &["falseeasting", "eastingatfalseorigin", "eastingatprojectioncentre"]),
    (Parameter::Northing, &["falsenorthing", "northingatfalseorigin", "northingatprojectioncentre"]),
];

/// A family of projections whose variants measure false coordinates from different points.
const OBLIQUE: &str = "oblique Mercator";
/// Families of projections by a part of their names. The first match counts; projections without a match have
/// no family to compare.
const METHODS: [(&str, &[&str]); 4] = [
    (OBLIQUE, &["obliquemercator", "hotine", "swissoblique"]),
    ("transverse Mercator", &["transversemercator", "gausskruger"]),
    ("Lambert conic conformal", &["lambertconformalconic", "lambertconicconformal"]),
    ("Albers", &["albers"]),
];

/// The known facts of a projection: angles in degrees, lengths in metres.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Projection {
    method: Option<&'static str>,
    values: Vec<(Parameter, f64)>,
}

impl Projection {
    /// The projection of a text; `None` if it has none.
    pub(super) fn of(text: &str) -> Option<Self> {
        let root = Node::parse(text)?;
        let system = projected(&root)?;
        let base = system.child(&["GEOGCS", "BASEGEOGCRS", "BASEGEODCRS"]);
        let conversion = system.child(&["CONVERSION"]);
        let method = conversion.unwrap_or(system).child(&["PROJECTION", "METHOD"])?;
        // Version 1 states the units once for all parameters, version 2 for each.
        // Programs do not agree on angles that are not in degrees.
        let degree = base.and_then(unit).map_or(1.0, f64::to_degrees);
        let degree = ((degree - 1.0).abs() < 1e-6).then_some(1.0);
        let metre = unit(system).unwrap_or(1.0);
        let method = family(method.name()?);
        let mut values: Vec<(Parameter, f64)> = conversion
            .unwrap_or(system)
            .children()
            .filter(|node| node.keyword == "PARAMETER")
            .filter_map(|node| {
                let parameter = parameter(node.name()?)?;
                let own = unit(node);
                let factor = match parameter {
                    Parameter::Scale => own.unwrap_or(1.0),
                    Parameter::Easting | Parameter::Northing if method == Some(OBLIQUE) => return None,
                    Parameter::Easting | Parameter::Northing => own.unwrap_or(metre),
                    _ => own.map(f64::to_degrees).or(degree)?,
                };
                Some((parameter, node.number()? * factor))
            })
            .collect();
        sort_parallels(&mut values);
        // Longitudes are measured from the prime meridian, whose own longitude has units on which programs do
        // not agree.
        if base
            .and_then(|base| base.child(&["PRIMEM", "PRIMEMERIDIAN"]))
            .is_some_and(|zero| zero.number().is_none_or(|longitude| longitude != 0.0))
        {
            values.retain(|(parameter, _)| *parameter != Parameter::Longitude);
        }
        let datum = base.and_then(|base| base.child(&["DATUM", "GEODETICDATUM", "TRF", "ENSEMBLE"]));
        let ellipsoid = datum.and_then(|datum| datum.child(&["SPHEROID", "ELLIPSOID"]));
        if let Some(axis) =
            ellipsoid.and_then(|ellipsoid| Some(ellipsoid.number()? * unit(ellipsoid).unwrap_or(1.0)))
        {
            values.push((Parameter::SemiMajorAxis, axis));
        }
        Some(Self { method, values })
    }

    /// Whether two projections differ in a number that both have, or belong to different families. Different
    /// names alone do not count.
    pub(super) fn differs_from(&self, other: &Self) -> bool {
        let methods = matches!((self.method, other.method), (Some(a), Some(b)) if a != b);
        methods
            || self.values.iter().any(|(parameter, value)| {
                let others = other.values.iter().filter(|(name, _)| name == parameter);
                others.clone().count() > 0
                    && others
                        .clone()
                        .all(|(_, other)| parameter.distance(*value, *other) > parameter.tolerance())
            })
    }
}

impl Parameter {
    /// The difference of two values. A longitude repeats after a full turn.
    fn distance(self, one: f64, other: f64) -> f64 {
        let apart = (one - other).abs();
        match self {
            Self::Longitude => {
                let turned = apart.rem_euclid(360.0);
                turned.min(360.0 - turned)
            }
            _ => apart,
        }
    }

    /// Largest difference that can come from rounding: numbers in files have 4 to 17 digits.
    fn tolerance(self) -> f64 {
        match self {
            Self::Scale => 1e-7,
            Self::Easting | Self::Northing => 0.01,
            // Ellipsoids that matter differ by 100 m and more; WGS 72 and WGS 84 differ by 2 m.
            Self::SemiMajorAxis => 1.0,
            // A metre on the ground.
            _ => 1e-5,
        }
    }
}

/// Sorts two standard parallels, because programs do not agree on which is the first.
fn sort_parallels(values: &mut [(Parameter, f64)]) {
    let find = |parameter| values.iter().position(|(name, _)| *name == parameter);
    let places = (find(Parameter::FirstParallel), find(Parameter::SecondParallel));
    if let (Some(first), Some(second)) = places
        && values[first].1 > values[second].1
    {
        (values[first].1, values[second].1) = (values[second].1, values[first].1);
    }
}

/// The projected system of a text, which may be a part of it.
fn projected(root: &Node) -> Option<&Node> {
    match root.keyword.as_str() {
        "PROJCS" | "PROJCRS" | "PROJECTEDCRS" => Some(root),
        "COMPD_CS" | "COMPOUNDCRS" => root.children().find_map(projected),
        "BOUNDCRS" => root.child(&["SOURCECRS"])?.children().find_map(projected),
        _ => None,
    }
}

/// The unit of a node, in radians or metres.
fn unit(node: &Node) -> Option<f64> {
    let unit = node.child(&["UNIT", "ANGLEUNIT", "LENGTHUNIT", "SCALEUNIT"])?.number()?;
    (unit.is_finite() && unit > 0.0).then_some(unit)
}

fn folded(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

fn parameter(name: &str) -> Option<Parameter> {
    let name = folded(name);
    PARAMETERS.iter().find(|(_, names)| names.contains(&name.as_str())).map(|(parameter, _)| *parameter)
}

fn family(name: &str) -> Option<&'static str> {
    let name = folded(name);
    METHODS.iter().find(|(_, parts)| parts.iter().any(|part| name.contains(part))).map(|(family, _)| *family)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIRST: &str = r#"PROJCS["x",GEOGCS["g",DATUM["d",SPHEROID["s",6378137,298.257]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",9],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1]]"#;
    const SECOND: &str = r#"COMPOUNDCRS["c",PROJCRS["y",BASEGEOGCRS["h",DATUM["e",ELLIPSOID["t",6378137.0,298.25,LENGTHUNIT["metre",1]]]],CONVERSION["z",METHOD["Transverse Mercator",ID["EPSG",9807]],PARAMETER["Latitude of natural origin",0,ANGLEUNIT["degree",0.0174532925199433]],PARAMETER["Longitude of natural origin",9,ANGLEUNIT["degree",0.0174532925199433]],PARAMETER["Scale factor at natural origin",0.9996,SCALEUNIT["unity",1]],PARAMETER["False easting",500,LENGTHUNIT["kilometre",1000]],PARAMETER["False northing",0,LENGTHUNIT["metre",1]]],CS[Cartesian,2]],VERTCRS["v"]]"#;

    fn differ(a: &str, b: &str) -> bool {
        let [a, b] = [a, b].map(|text| Projection::of(text).expect("a projection"));
        assert_eq!(a.differs_from(&b), b.differs_from(&a));
        a.differs_from(&b)
    }

    #[test]
    fn numbers_are_compared_in_both_versions_and_names_are_not() {
        assert!(!differ(FIRST, FIRST));
        assert!(!differ(FIRST, SECOND));
        assert!(!differ(
            FIRST,
            &FIRST.replace("Transverse_Mercator", "Gauss_Kruger").replace("0.9996", "0.99960000001")
        ));
        assert!(!differ(FIRST, &FIRST.replace("PARAMETER[\"false_easting\",500000],", "")));
        assert!(!differ(FIRST, definition(25_832).expect("UTM 32N")));
        for (old, new) in [
            ("central_meridian\",9", "central_meridian\",15"),
            ("0.9996", "1"),
            ("500000", "3500000"),
            ("6378137", "6377397.155"),
            ("Transverse_Mercator", "Lambert_Conformal_Conic_2SP"),
        ] {
            assert!(differ(&FIRST.replace(old, new), SECOND), "{new}");
        }
        assert!(differ(SECOND, definition(25_833).expect("UTM 33N")));
    }

    #[test]
    fn other_units_and_meridians_are_understood_or_left_out() {
        // Mississippi West, whose false easting is in US survey feet in one code and in metres in the other.
        let [feet, metres] = [2_254, 26_994].map(|code| definition(code).expect("a text"));
        assert!(!differ(feet, metres));
        let paris = FIRST.replace("\"Greenwich\",0", "\"Paris\",2.33722917").replace(",9]", ",6.66277083]");
        assert!(!differ(FIRST, &paris));
        let turned = FIRST.replace("meridian\",9]", "meridian\",-351]");
        assert!(!differ(FIRST, &turned));
        // Lambert 93, whose parallels some programs swap; and a system whose angles may be gons or degrees.
        let lambert = definition(2_154).expect("a text");
        let [one, two] = ["standard_parallel_1", "standard_parallel_2"];
        assert!(lambert.contains(one) && lambert.contains(two), "{lambert}");
        assert!(!differ(
            lambert,
            &lambert.replace(one, "x").replace(two, one).replace("\"x\"", &format!("\"{two}\""))
        ));
        let gon = FIRST.replace("\"degree\",0.0174532925199433", "\"gon\",0.0157079632679490");
        assert!(!differ(FIRST, &gon));
    }

    #[test]
    fn every_definition_of_a_projection_equals_itself_and_what_is_none_is_not_read() {
        let mut read = 0;
        for code in 1..=u32::from(u16::MAX) {
            if let Some(projection) = definition(code).and_then(Projection::of) {
                assert!(!projection.differs_from(&projection), "EPSG:{code}");
                read += 1;
            }
        }
        assert!(read > 3_000, "{read}");
        for text in
            ["", "PROJCS[\"x\"]", "GEOGCS[\"g\",UNIT[\"degree\",0.0174]]", "PROJCS[\"x\",PROJECTION[]]"]
        {
            assert_eq!(Projection::of(text), None, "{text}");
        }
    }
}
