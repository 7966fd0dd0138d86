//! What the records of a file claim about its coordinate reference system: kind, code, units and name, from
//! well-known text and from GeoTIFF keys. Claims that cannot be true are rejected with a warning.

use super::epsg_units::{unit_of_code, unit_of_vertical_system};
use super::geokeys::GeoKeys;
use super::projection::definition;
use super::unit::{plausible, unit_in_words};
use super::wkt::Node;
use crate::words::decimal;

/// The kind of coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CrsKind {
    /// Lengths in a plane, and a height.
    Projected,
    /// Angles on an ellipsoid.
    Geographic,
    /// Lengths from the centre of the earth.
    Geocentric,
    /// Unknown, or a local system.
    #[default]
    Unknown,
}

/// What one record says about the system; `None` for facts that it does not give.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Claim {
    pub(super) epsg: Option<u32>,
    pub(super) kind: CrsKind,
    pub(super) horizontal: Option<f64>,
    pub(super) vertical: Option<f64>,
    /// EPSG code of the vertical system.
    pub(super) vertical_code: Option<u32>,
    pub(super) name: Option<String>,
}

impl Claim {
    /// Adds the facts that only the other record gives, if both describe the same kind of system in the same
    /// unit.
    pub(super) fn completed_by(self, other: &Self) -> Self {
        let units =
            matches!((self.horizontal, other.horizontal), (Some(a), Some(b)) if (a / b - 1.0).abs() > 1e-9);
        if self.kind != other.kind || units {
            return self;
        }
        Self {
            epsg: self.epsg.or(other.epsg),
            kind: self.kind,
            horizontal: self.horizontal.or(other.horizontal),
            vertical: self.vertical.or(other.vertical),
            vertical_code: self.vertical_code.or(other.vertical_code),
            name: self.name.or_else(|| other.name.clone()),
        }
    }

    /// Rejects a claim that contradicts the extent in the header: angles beyond a full turn, or geocentric
    /// positions that are not near the surface of the earth. Such records come from careless conversions.
    pub(super) fn dismissed_by(self, extent: [[f64; 3]; 2], warnings: &mut Vec<String>) -> Self {
        let [low, high] = extent;
        if !low.iter().chain(&high).all(|value| value.is_finite()) {
            return self;
        }
        let largest = |axes: std::ops::Range<usize>| {
            axes.map(|axis| low[axis].abs().max(high[axis].abs())).fold(0.0, f64::max)
        };
        let radius_m = low.iter().map(|value| value * value).sum::<f64>().sqrt();
        let impossible = match self.kind {
            CrsKind::Geographic => largest(0..2) > 400.0,
            // The earth's surface is 6,352 to 6,385 km from its centre.
            CrsKind::Geocentric => radius_m > 0.0 && !(6.2e6..6.6e6).contains(&radius_m),
            CrsKind::Projected | CrsKind::Unknown => false,
        };
        if !impossible {
            return self;
        }
        warnings.push(format!(
            "the coordinate system {:?} is {:?}, but coordinates reach {}, which is impossible for it: it is ignored, \
             and metres are assumed",
            self.name.unwrap_or_default(),
            self.kind,
            decimal(largest(0..3), 0)
        ));
        Self::default()
    }

    /// Drops a code that the EPSG dataset does not have. Programs that look it up refuse the whole file.
    pub(super) fn without_unknown_code(self, warnings: &mut Vec<String>) -> Self {
        let Some(code) = self.epsg.filter(|code| definition(*code).is_none()) else { return self };
        warnings.push(format!(
            "EPSG:{code} is not known (it is wrong, or newer than this program): the outputs do not name this code"
        ));
        let name = self.name.unwrap_or_else(|| format!("EPSG:{code}"));
        Self { epsg: None, name: Some(format!("{name} (unknown code)")), ..self }
    }

    /// Completes the unit from the definition of the code. A projected system with another unit is not the
    /// system of its code: coordinates in feet under the code of a system in metres lie elsewhere.
    pub(super) fn compared_with_epsg(mut self, warnings: &mut Vec<String>) -> Self {
        let Some(code) = self.epsg.filter(|_| self.kind == CrsKind::Projected) else { return self };
        let defined = definition(code).and_then(Node::parse).as_ref().and_then(length_unit);
        match (self.horizontal, defined) {
            (Some(unit), Some(defined)) if (unit / defined - 1.0).abs() > 1e-6 => {
                warnings.push(format!(
                    "coordinates are in {}, but those of EPSG:{code} are in {}: the outputs do not name this code",
                    unit_in_words(unit),
                    unit_in_words(defined)
                ));
                let name = self.name.unwrap_or_else(|| format!("EPSG:{code}"));
                Self { epsg: None, name: Some(format!("{name}, but in {}", unit_in_words(unit))), ..self }
            }
            (unit, defined) => {
                self.horizontal = unit.or(defined);
                self
            }
        }
    }

    /// Completes the unit of heights from the code of the vertical system.
    pub(super) fn with_unit_of_heights(self) -> Self {
        let vertical = self.vertical.or_else(|| self.vertical_code.and_then(unit_of_vertical_system));
        Self { vertical, ..self }
    }

    pub(super) fn warn_about_unit(&self, warnings: &mut Vec<String>) {
        if self.kind != CrsKind::Projected {
            return;
        }
        if self.horizontal.is_none() {
            warnings.push(
                "the unit of length of the coordinate system is not known; metres are assumed (if that is wrong, set input.unit)"
                    .into(),
            );
        }
        // Where x and y are in metres, heights usually are, too.
        let unit_m = self.horizontal.filter(|unit| (unit - 1.0).abs() > 1e-9);
        if let (Some(unit_m), None, Some(code)) = (unit_m, self.vertical, self.vertical_code) {
            let unit = unit_in_words(unit_m);
            warnings.push(format!(
                "the unit of the vertical system {code} is not known: heights are taken to be in {unit}, as x and y are \
                 (if that is wrong, write the unit into the files)"
            ));
        }
    }

    /// One unit of x and y, and one of z, in metres: 1 where no unit is known, and that of x and y for z.
    pub(super) fn units_m(&self) -> [f64; 2] {
        let horizontal_m = self.horizontal.unwrap_or(1.0);
        [horizontal_m, self.vertical.unwrap_or(horizontal_m)]
    }
}

/// The claim of a well-known text (version 1 or 2); `None` if the kind of its outermost system is unknown.
pub(super) fn claim_of_wkt(root: &Node) -> Option<Claim> {
    let claim = |node: &Node, kind: CrsKind| Claim {
        epsg: node.epsg(),
        kind,
        horizontal: length_unit(node),
        vertical: None,
        vertical_code: None,
        name: node.name().filter(|name| !name.is_empty()).map(str::to_owned),
    };
    match root.keyword.as_str() {
        "COMPD_CS" | "COMPOUNDCRS" => {
            let mut parts = root.children().filter_map(claim_of_wkt);
            let horizontal = parts.next()?;
            let system = root.children().find_map(vertical_system);
            let vertical = system.and_then(length_unit);
            let vertical_code = system.and_then(Node::epsg);
            let name = root.name().map(str::to_owned).or_else(|| horizontal.name.clone());
            let epsg = horizontal.epsg.or_else(|| horizontal_code(root.epsg()?));
            Some(Claim { epsg, vertical, vertical_code, name, ..horizontal })
        }
        "BOUNDCRS" => claim_of_wkt(root.child(&["SOURCECRS"])?.children().next()?),
        "PROJCS" | "PROJCRS" | "PROJECTEDCRS" => Some(claim(root, CrsKind::Projected)),
        "GEOCCS" => Some(claim(root, CrsKind::Geocentric)),
        "GEOGCS" | "GEOGCRS" | "GEOGRAPHICCRS" | "GEODCRS" | "GEODETICCRS" => {
            let cartesian = root.child(&["CS"]).and_then(Node::word) == Some("CARTESIAN");
            let kind = if cartesian { CrsKind::Geocentric } else { CrsKind::Geographic };
            Some(Claim { horizontal: None, ..claim(root, kind) })
        }
        "LOCAL_CS" | "ENGCRS" | "ENGINEERINGCRS" => Some(claim(root, CrsKind::Unknown)),
        _ => None,
    }
}

/// The code of the horizontal part of a compound system. Well-known text of version 2 may give a code only
/// for the whole system.
fn horizontal_code(compound: u32) -> Option<u32> {
    let root = definition(compound).and_then(Node::parse)?;
    root.children().find_map(claim_of_wkt)?.epsg
}

/// The vertical system that a part of a compound system is.
fn vertical_system(part: &Node) -> Option<&Node> {
    match part.keyword.as_str() {
        "VERT_CS" | "VERTCRS" | "VERTICALCRS" => Some(part),
        "BOUNDCRS" => part.child(&["SOURCECRS"])?.children().find_map(vertical_system),
        _ => None,
    }
}

/// The unit of a system in metres: its own unit, or that of its first axis.
fn length_unit(node: &Node) -> Option<f64> {
    const UNITS: &[&str] = &["UNIT", "LENGTHUNIT"];
    let unit = node.child(UNITS).or_else(|| node.child(&["AXIS"])?.child(UNITS))?;
    unit.number().and_then(plausible)
}

/// The claim of GeoTIFF keys (OGC GeoTIFF 1.1, annex C); `None` if they name no system. Codes of units that
/// are not known become warnings.
pub(super) fn claim_of_keys(keys: &GeoKeys, warnings: &mut Vec<String>) -> Option<Claim> {
    let code = |id: u16| keys.code(id).filter(|code| *code != USER_DEFINED).map(u32::from);
    let model = keys.code(1024);
    let projected = keys.code(3072);
    let geographic = keys.code(2048);
    let kind = match (model, projected, geographic) {
        (Some(1), ..) | (_, Some(_), _) => CrsKind::Projected,
        (Some(2), ..) => CrsKind::Geographic,
        (Some(3), ..) => CrsKind::Geocentric,
        (_, None, Some(_)) => CrsKind::Geographic,
        _ => return None,
    };
    let (epsg, name) = match kind {
        CrsKind::Projected => (code(3072), keys.text(3073).or_else(|| keys.text(1026))),
        _ => (code(2048), keys.text(2049).or_else(|| keys.text(1026))),
    };
    let horizontal = match kind {
        CrsKind::Projected => unit_of_key(keys, 3076, keys.number(3077), warnings),
        _ => None,
    };
    let vertical = unit_of_key(keys, 4099, None, warnings);
    Some(Claim { epsg, kind, horizontal, vertical, vertical_code: keys.code(4096).map(u32::from), name })
}

/// A GeoTIFF code for what other keys describe.
const USER_DEFINED: u16 = 32_767;

/// Metres of the unit whose code a GeoTIFF key has, or else of the unit of `own` metres.
fn unit_of_key(keys: &GeoKeys, id: u16, own: Option<f64>, warnings: &mut Vec<String>) -> Option<f64> {
    let code = keys.code(id);
    let unit = code.and_then(unit_of_code).or_else(|| own.and_then(plausible));
    if let (Some(code), None) = (code, unit) {
        warnings.push(format!("the unit of length {code} (GeoTIFF key {id}) is not known and is ignored"));
    }
    unit
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{FOOT, US_SURVEY_FOOT};

    fn of(text: &str) -> Option<Claim> {
        Node::parse(text).as_ref().and_then(claim_of_wkt)
    }

    #[test]
    fn well_known_texts_of_both_generations_give_kind_code_and_units() {
        let utm = of(
            "PROJCS[\"U\",GEOGCS[\"g\",UNIT[\"degree\",0.0174]],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]",
        );
        let utm = utm.expect("a system");
        assert_eq!((utm.kind, utm.epsg, utm.horizontal), (CrsKind::Projected, Some(25_832), Some(1.0)));
        let feet = of("COMPD_CS[\"both\",PROJCS[\"p\",UNIT[\"US survey foot\",0.3048006096012192]],\
             VERT_CS[\"v\",UNIT[\"metre\",1]]]")
        .expect("a system");
        assert_eq!((feet.horizontal, feet.vertical), (Some(US_SURVEY_FOOT), Some(1.0)));
        let second = of("BOUNDCRS[SOURCECRS[PROJCRS[\"p\",BASEGEOGCRS[\"g\"],CS[Cartesian,2],\
             AXIS[\"e\",east,LENGTHUNIT[\"foot\",0.3048]],ID[\"EPSG\",2992]]],TARGETCRS[GEOGCRS[\"w\"]]]")
        .expect("a system");
        assert_eq!(
            (second.kind, second.epsg, second.horizontal),
            (CrsKind::Projected, Some(2992), Some(FOOT))
        );
        let compound =
            of("COMPOUNDCRS[\"RD + NAP\",PROJCRS[\"RD\",CS[Cartesian,2],LENGTHUNIT[\"metre\",1]],\
             VERTCRS[\"NAP\",LENGTHUNIT[\"metre\",1]],ID[\"EPSG\",7415]]")
            .expect("a system");
        assert_eq!((compound.epsg, compound.name.as_deref()), (Some(28_992), Some("RD + NAP")));
        let kinds = [
            ("GEOGCS[\"WGS 84\",UNIT[\"degree\",0.0174]]", CrsKind::Geographic),
            ("GEODCRS[\"WGS 84\",CS[Cartesian,3]]", CrsKind::Geocentric),
            ("GEODCRS[\"WGS 84\",CS[ellipsoidal,2]]", CrsKind::Geographic),
            ("GEOCCS[\"WGS 84\",UNIT[\"metre\",1]]", CrsKind::Geocentric),
            ("LOCAL_CS[\"site\",UNIT[\"foot\",0.3048]]", CrsKind::Unknown),
        ];
        for (text, kind) in kinds {
            assert_eq!(of(text).map(|claim| claim.kind), Some(kind), "{text}");
        }
        assert_eq!(of("VERT_CS[\"v\"]"), None);
    }

    #[test]
    fn the_unit_of_a_code_completes_the_keys_or_contradicts_them() {
        let compared = |entries: &[(u16, u16)]| {
            let mut warnings = Vec::new();
            let claim = keys(entries).expect("a system").compared_with_epsg(&mut warnings);
            (claim.epsg, claim.horizontal, warnings.join(" "))
        };
        let none = String::new();
        // Mississippi West: in US survey feet and in metres.
        assert_eq!(compared(&[(1024, 1), (3072, 2_255)]), (Some(2_255), Some(US_SURVEY_FOOT), none.clone()));
        assert_eq!(compared(&[(1024, 1), (3072, 26_995)]), (Some(26_995), Some(1.0), none.clone()));
        let both = compared(&[(1024, 1), (3072, 2_255), (3076, 9_003)]);
        assert_eq!(both, (Some(2_255), Some(US_SURVEY_FOOT), none));
        let (epsg, unit, warning) = compared(&[(1024, 1), (3072, 26_995), (3076, 9_003)]);
        assert_eq!((epsg, unit), (None, Some(US_SURVEY_FOOT)));
        assert!(warning.contains("in US survey feet, but those of EPSG:26995 are in metres"), "{warning}");
    }

    fn keys(entries: &[(u16, u16)]) -> Option<Claim> {
        let count = u16::try_from(entries.len()).expect("few");
        let mut words = vec![1_u16, 1, 0, count];
        words.extend(entries.iter().flat_map(|(id, value)| [*id, 0, 1, *value]));
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let keys = GeoKeys::parse(&bytes, Vec::new(), Vec::new())?;
        claim_of_keys(&keys, &mut Vec::new())
    }

    /// Units of x and y and of heights in metres, and the number of warnings about them.
    fn units_of(entries: &[(u16, u16)]) -> (f64, f64, usize) {
        let mut warnings = Vec::new();
        let claim = keys(entries).expect("a system").compared_with_epsg(&mut warnings).with_unit_of_heights();
        claim.warn_about_unit(&mut warnings);
        let [horizontal_m, vertical_m] = claim.units_m();
        (horizontal_m, vertical_m, warnings.len())
    }

    #[test]
    fn the_vertical_system_gives_the_unit_of_heights() {
        // EPSG:2255 is in US survey feet, EPSG:26915 in metres; NAVD88 in metres, US survey feet and feet.
        for (entries, expected) in [
            (vec![(3072, 2255)], (US_SURVEY_FOOT, US_SURVEY_FOOT, 0)),
            (vec![(3072, 2255), (4096, 5703)], (US_SURVEY_FOOT, 1.0, 0)),
            (vec![(3072, 26_915), (4096, 6360)], (1.0, US_SURVEY_FOOT, 0)),
            (vec![(3072, 26_915), (4096, 8228)], (1.0, FOOT, 0)),
            // The unit itself counts more than that of the code.
            (vec![(3072, 26_915), (4096, 8228), (4099, 9001)], (1.0, 1.0, 0)),
            // The datum of NAVD88 and a system of one's own have no unit.
            (vec![(3072, 2255), (4096, 5103)], (US_SURVEY_FOOT, US_SURVEY_FOOT, 1)),
            (vec![(3072, 2255), (4096, USER_DEFINED)], (US_SURVEY_FOOT, US_SURVEY_FOOT, 1)),
            (vec![(3072, 26_915), (4096, 5103)], (1.0, 1.0, 0)),
        ] {
            assert_eq!(units_of(&entries), expected, "{entries:?}");
        }
    }

    #[test]
    fn every_unit_of_length_is_read_and_an_unknown_one_is_named() {
        let mut warnings = Vec::new();
        let mut unit = |code: u16| {
            let words = [1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, code];
            let bytes: Vec<u8> = words.iter().flat_map(|word: &u16| word.to_le_bytes()).collect();
            let keys = GeoKeys::parse(&bytes, Vec::new(), Vec::new()).expect("keys");
            claim_of_keys(&keys, &mut warnings).expect("a system").horizontal
        };
        assert_eq!([9001, 9005, 9036].map(&mut unit), [Some(1.0), Some(0.304_797_265_4), Some(1_000.0)]);
        assert_eq!(unit(9102), None, "a degree");
        assert_eq!(warnings, ["the unit of length 9102 (GeoTIFF key 3076) is not known and is ignored"]);
    }

    #[test]
    fn geotiff_keys_give_kind_code_and_units() {
        let claim = keys(&[(1024, 1), (3072, 2994), (3076, 9002), (4099, 9003)]).expect("a system");
        assert_eq!((claim.kind, claim.epsg), (CrsKind::Projected, Some(2994)));
        assert_eq!((claim.horizontal, claim.vertical), (Some(FOOT), Some(US_SURVEY_FOOT)));
        let claim = keys(&[(1024, 2), (2048, 4326)]).expect("a system");
        assert_eq!((claim.kind, claim.epsg), (CrsKind::Geographic, Some(4326)));
        let claim = keys(&[(1024, 1), (3072, 32_767)]).expect("a system");
        assert_eq!((claim.kind, claim.epsg, claim.horizontal), (CrsKind::Projected, None, None));
        assert_eq!(keys(&[(1025, 1)]), None);
    }

    #[test]
    fn claims_that_the_extent_refutes_are_dropped_with_a_warning() {
        let kind_after = |kind, low, high| {
            let mut warnings = Vec::new();
            let claim = Claim { kind, ..Claim::default() }.dismissed_by([low, high], &mut warnings);
            (claim.kind, warnings.len())
        };
        let degrees = ([-123.1, 44.0, 100.0], [-123.0, 44.1, 900.0]);
        let utm = ([515_368.6, 4_918_340.0, 2_322.9], [515_401.0, 4_918_381.0, 2_338.6]);
        let centre = ([4_000_000.0, 600_000.0, 4_900_000.0], [4_000_010.0, 600_010.0, 4_900_010.0]);
        assert_eq!(kind_after(CrsKind::Geographic, degrees.0, degrees.1), (CrsKind::Geographic, 0));
        assert_eq!(kind_after(CrsKind::Geographic, utm.0, utm.1), (CrsKind::Unknown, 1));
        assert_eq!(kind_after(CrsKind::Geocentric, utm.0, utm.1), (CrsKind::Unknown, 1));
        assert_eq!(kind_after(CrsKind::Geocentric, centre.0, centre.1), (CrsKind::Geocentric, 0));
        assert_eq!(kind_after(CrsKind::Geographic, [f64::NAN; 3], utm.1), (CrsKind::Geographic, 0));
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "units are constants")]
    fn the_vertical_part_of_a_text_gives_the_unit_of_heights() {
        let unit_m = |vertical: &str| {
            let plane = r#"PROJCS["x",UNIT["US survey foot",0.3048006096012192]]"#;
            let claim = of(&format!("COMPD_CS[\"c\",{plane},{vertical}]")).expect("a system");
            claim.with_unit_of_heights().units_m()[1]
        };
        let code = r#"VERT_CS["NAVD88 height",VERT_DATUM["d",2005],AUTHORITY["EPSG","5703"]]"#;
        assert_eq!(unit_m(code), 1.0);
        assert_eq!(unit_m(&code.replace("5703", "8228")), FOOT);
        assert_eq!(unit_m(&code.replace(",AUTHORITY", ",UNIT[\"foot\",0.3048],AUTHORITY")), FOOT);
        assert_eq!(unit_m(&format!("BOUNDCRS[SOURCECRS[{code}]]")), 1.0);
        assert_eq!(unit_m(&code.replace("5703", "5103")), US_SURVEY_FOOT);
    }
}
