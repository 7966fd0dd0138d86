//! The coordinate reference system of a file, as far as processing needs it: kind, units, name. Coordinates
//! are never transformed. The records that describe the system are copied to the output unchanged.

use super::crs_records::{geo_keys, wkt_text};
use super::geokeys::GeoKeys;
use super::header::Header;
use super::mapped::ByteSource;
use super::projection::{Projection, definition, without_codes};
use super::unit::{plausible, unit_in_words};
use super::wkt::Node;
use crate::config::{FOOT, LengthUnit, US_SURVEY_FOOT};
use crate::words::decimal;

/// Bit of the global encoding: the system is given as well-known text.
const WKT_BIT: u16 = 1 << 4;
/// Why a system has no name.
const NOT_UNDERSTOOD: &str = "given but not understood";
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

/// The coordinate reference system of a file, as far as it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Crs {
    /// The well-known text, if the file has one. It has no code where `epsg` is unknown: other programs would
    /// look the code up and ignore the rest. A text that is not understood is kept as it is.
    pub wkt: Option<String>,
    /// Whether the file describes its system, but no record of it is understood.
    pub not_understood: bool,
    /// EPSG code of the horizontal system, if the file names one.
    pub epsg: Option<u32>,
    /// The kind of coordinates.
    pub kind: CrsKind,
    /// One unit of x and y in metres (1 if the file does not say).
    pub horizontal_unit_m: f64,
    /// One unit of z in metres (that of x and y if the file does not say).
    pub vertical_unit_m: f64,
    /// A readable name.
    pub description: String,
}

impl Crs {
    /// The system of a drive without any record of one, whose coordinates are in this unit.
    #[must_use]
    pub fn unknown(unit: LengthUnit) -> Self {
        Claim::default().into_crs(None).nameless("not given in the files", unit)
    }

    /// The system of a drive whose files describe it in a way that is not understood.
    pub(crate) fn in_unit(&self, unit: LengthUnit) -> Self {
        self.clone().nameless(NOT_UNDERSTOOD, unit)
    }

    /// The description of a system without a name: why there is none, and in which unit coordinates are.
    fn nameless(self, why: &str, unit: LengthUnit) -> Self {
        let unit = match unit {
            LengthUnit::Auto => "coordinates are taken as metres".to_owned(),
            _ => format!("input.unit is {}", unit.name()),
        };
        Self { description: format!("{why} ({unit})"), ..self }
    }

    /// Whether the file describes its system in a way that is understood.
    #[must_use]
    pub fn is_known(&self) -> bool {
        let has_text = self.wkt.is_some() && !self.not_understood;
        self.kind != CrsKind::Unknown || has_text || self.epsg.is_some()
    }

    /// Whether two known systems contradict each other: by code, kind or unit, or by the numbers of their
    /// projections if one has no code.
    #[must_use]
    pub fn contradicts(&self, other: &Self) -> bool {
        if !self.is_known() || !other.is_known() {
            return false;
        }
        let same = |a: f64, b: f64| (a - b).abs() <= a * 1e-9;
        let codes = matches!((self.epsg, other.epsg), (Some(a), Some(b)) if a != b);
        let units = !same(self.horizontal_unit_m, other.horizontal_unit_m)
            || !same(self.vertical_unit_m, other.vertical_unit_m);
        codes || self.kind != other.kind || units || self.projections_differ(other)
    }

    /// Whether the texts show different projections. Equal codes say that they are equal; a text that cannot
    /// be read says nothing.
    fn projections_differ(&self, other: &Self) -> bool {
        if self.epsg.is_some() && other.epsg.is_some() {
            return false;
        }
        let [first, second] = [self, other].map(|crs| crs.text().and_then(Projection::of));
        matches!((first, second), (Some(first), Some(second)) if first.differs_from(&second))
    }

    /// Well-known text for an output: that of the file, or that of the EPSG dataset for its code.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        self.wkt.as_deref().or_else(|| definition(self.epsg?))
    }

    /// The system named by the records of a file. Records that are not understood become warnings.
    pub(crate) fn read(header: &Header, source: &ByteSource, warnings: &mut Vec<String>) -> Self {
        let text = wkt_text(header, source);
        let keys = geo_keys(header, source);
        let understood = |text: &String| Node::parse(text).as_ref().and_then(claim_of_wkt);
        let from_text = text.as_ref().ok().and_then(Option::as_ref).and_then(understood);
        let is_odd = from_text.is_none() && !matches!(text, Ok(None));
        let odd_text = is_odd.then_some(("well-known text", "is"));
        let odd_keys = keys.is_err().then_some(("GeoTIFF keys", "are"));
        let text = text.ok().flatten();
        let from_keys = keys.ok().flatten().as_ref().and_then(claim_of_keys);
        let odd: Vec<(&str, &str)> = odd_text.into_iter().chain(odd_keys).collect();
        if !odd.is_empty() && from_text.is_none() && from_keys.is_none() {
            let names: Vec<&str> = odd.iter().map(|(name, _)| *name).collect();
            return Self::only_odd(text, &names.join(" and "), warnings);
        }
        for (name, verb) in odd {
            warnings.push(format!("the {name} of the coordinate system cannot be read and {verb} ignored"));
        }
        let text = text.filter(|_| from_text.is_some());
        let prefer_text = header.global_encoding & WKT_BIT != 0;
        let (first, second) = if prefer_text { (from_text, from_keys) } else { (from_keys, from_text) };
        let claim = match (first, second) {
            (Some(first), Some(second)) => first.completed_by(&second),
            (first, second) => first.or(second).unwrap_or_default(),
        };
        let claim = claim
            .dismissed_by(header.extent, warnings)
            .without_unknown_code(warnings)
            .compared_with_epsg(warnings);
        let text = text.filter(|_| claim != Claim::default());
        let text = text.map(|text| if claim.epsg.is_none() { without_codes(text) } else { text });
        claim.warn_about_unit(warnings);
        claim.into_crs(text)
    }

    /// The system of a file whose records are not understood. Outputs keep the text as it is.
    fn only_odd(text: Option<String>, records: &str, warnings: &mut Vec<String>) -> Self {
        let kept = if text.is_some() { ", and objects.gpkg gets the text" } else { "" };
        warnings.push(format!(
            "the coordinate system is given but not understood ({records}): copies keep it as it is{kept}; write it again \
             with the program that made the file, and set input.unit if coordinates are not in metres"
        ));
        let crs = Self { not_understood: true, ..Claim::default().into_crs(text) };
        crs.in_unit(LengthUnit::Auto)
    }
}

/// The content of one record; `None` for what it does not say.
#[derive(Debug, Clone, Default, PartialEq)]
struct Claim {
    epsg: Option<u32>,
    kind: CrsKind,
    horizontal: Option<f64>,
    vertical: Option<f64>,
    name: Option<String>,
}

impl Claim {
    /// Adds what only the other record says, if both describe the same kind of system in the same unit.
    fn completed_by(self, other: &Self) -> Self {
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
            name: self.name.or_else(|| other.name.clone()),
        }
    }

    /// Rejects a claim that contradicts the extent in the header: angles beyond a full turn, or geocentric
    /// positions that are not near the surface of the earth. Such records come from careless conversions.
    fn dismissed_by(self, extent: [[f64; 3]; 2], warnings: &mut Vec<String>) -> Self {
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
            "the coordinate system {:?} is {:?}, which coordinates up to {} cannot be; it is ignored and metres are \
             assumed",
            self.name.unwrap_or_default(),
            self.kind,
            decimal(largest(0..3), 0)
        ));
        Self::default()
    }

    /// Drops a code that the EPSG dataset does not have. Programs that look it up refuse the whole file.
    fn without_unknown_code(self, warnings: &mut Vec<String>) -> Self {
        let Some(code) = self.epsg.filter(|code| definition(*code).is_none()) else { return self };
        warnings.push(format!(
            "EPSG:{code} is not known (it is wrong, or newer than this program): the outputs do not name this code"
        ));
        let name = self.name.unwrap_or_else(|| format!("EPSG:{code}"));
        Self { epsg: None, name: Some(format!("{name} (unknown code)")), ..self }
    }

    /// Completes the unit from the definition of the code. A projected system with another unit is not that
    /// of its code: coordinates in feet under the code of a system in metres lie elsewhere.
    fn compared_with_epsg(mut self, warnings: &mut Vec<String>) -> Self {
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

    fn warn_about_unit(&self, warnings: &mut Vec<String>) {
        if self.kind == CrsKind::Projected && self.horizontal.is_none() {
            warnings.push(
                "the coordinate system does not say its unit of length; metres are assumed (if that is wrong, set input.unit)"
                    .into(),
            );
        }
    }

    fn into_crs(self, wkt: Option<String>) -> Crs {
        let horizontal_unit_m = self.horizontal.unwrap_or(1.0);
        let description = match (&self.name, self.epsg) {
            (Some(name), Some(code)) => format!("{name} (EPSG:{code})"),
            (Some(name), None) => name.clone(),
            (None, Some(code)) => format!("EPSG:{code}"),
            (None, None) => match self.kind {
                CrsKind::Projected => "an unnamed projected system".into(),
                CrsKind::Geographic => "an unnamed geographic system".into(),
                CrsKind::Geocentric => "an unnamed geocentric system".into(),
                CrsKind::Unknown => "not given in the files (coordinates are taken as metres)".into(),
            },
        };
        Crs {
            wkt,
            not_understood: false,
            epsg: self.epsg,
            kind: self.kind,
            horizontal_unit_m,
            vertical_unit_m: self.vertical.unwrap_or(horizontal_unit_m),
            description,
        }
    }
}

/// Whether x and y could be longitude and latitude: small numbers in steps far below the resolution of a
/// scanner in metres (1e-7 degrees are a centimetre).
pub(super) fn looks_like_degrees(scale: [f64; 3], extent: [[f64; 3]; 2]) -> bool {
    let inside = |axis: usize, limit: f64| extent.iter().all(|corner| corner[axis].abs() <= limit);
    scale[0] <= 2e-7 && scale[1] <= 2e-7 && inside(0, 180.0) && inside(1, 90.0)
}

/// The claim of a well-known text (version 1 or 2); `None` if the kind of its outermost system is unknown.
fn claim_of_wkt(root: &Node) -> Option<Claim> {
    let claim = |node: &Node, kind: CrsKind| Claim {
        epsg: node.epsg(),
        kind,
        horizontal: length_unit(node),
        vertical: None,
        name: node.name().filter(|name| !name.is_empty()).map(str::to_owned),
    };
    match root.keyword.as_str() {
        "COMPD_CS" | "COMPOUNDCRS" => {
            let mut parts = root.children().filter_map(claim_of_wkt);
            let horizontal = parts.next()?;
            let vertical = root.child(&["VERT_CS", "VERTCRS", "VERTICALCRS"]).and_then(length_unit);
            let name = root.name().map(str::to_owned).or_else(|| horizontal.name.clone());
            let epsg = horizontal.epsg.or_else(|| horizontal_code(root.epsg()?));
            Some(Claim { epsg, vertical, name, ..horizontal })
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

/// The code of the horizontal system of a compound system. Well-known text of version 2 may name only the
/// code of the whole.
fn horizontal_code(compound: u32) -> Option<u32> {
    let root = definition(compound).and_then(Node::parse)?;
    root.children().find_map(claim_of_wkt)?.epsg
}

/// The unit of a system in metres: its own unit, or that of its first axis.
fn length_unit(node: &Node) -> Option<f64> {
    const UNITS: &[&str] = &["UNIT", "LENGTHUNIT"];
    let unit = node.child(UNITS).or_else(|| node.child(&["AXIS"])?.child(UNITS))?;
    unit.number().and_then(plausible)
}

/// The claim of GeoTIFF keys (OGC GeoTIFF 1.1, annex C); `None` if they name no system.
fn claim_of_keys(keys: &GeoKeys) -> Option<Claim> {
    const USER_DEFINED: u16 = 32_767;
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
    let unit = |code: Option<u16>| match code? {
        9001 => Some(1.0),
        9002 => Some(FOOT),
        9003 => Some(US_SURVEY_FOOT),
        _ => None,
    };
    let (epsg, name) = match kind {
        CrsKind::Projected => (code(3072), keys.text(3073).or_else(|| keys.text(1026))),
        _ => (code(2048), keys.text(2049).or_else(|| keys.text(1026))),
    };
    let horizontal = match kind {
        CrsKind::Projected => unit(keys.code(3076)).or_else(|| keys.number(3077).and_then(plausible)),
        _ => None,
    };
    Some(Claim { epsg, kind, horizontal, vertical: unit(keys.code(4099)), name })
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn a_code_without_text_has_that_of_the_epsg_dataset() {
        let claim = Claim { epsg: Some(32_632), kind: CrsKind::Projected, ..Claim::default() };
        let text = claim.clone().into_crs(None).text().map(str::to_owned).expect("a text");
        assert!(text.starts_with("PROJCS[\"WGS 84 / UTM zone 32N\""), "{text}");
        assert_eq!(claim.clone().into_crs(Some("its own".to_owned())).text(), Some("its own"));
        assert_eq!(Claim { epsg: Some(999_999), ..claim }.into_crs(None).text(), None);
    }

    fn keys(entries: &[(u16, u16)]) -> Option<Claim> {
        let count = u16::try_from(entries.len()).expect("few");
        let mut words = vec![1_u16, 1, 0, count];
        words.extend(entries.iter().flat_map(|(id, value)| [*id, 0, 1, *value]));
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        GeoKeys::parse(&bytes, Vec::new(), Vec::new()).as_ref().and_then(claim_of_keys)
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
    fn degrees_are_suspected_by_step_and_range_together() {
        let here = [[8.1, 48.0, 100.0], [8.2, 48.1, 120.0]];
        assert!(looks_like_degrees([1e-7, 1e-7, 0.01], here));
        assert!(!looks_like_degrees([1e-3, 1e-3, 1e-3], here));
        assert!(!looks_like_degrees([1e-7, 1e-7, 0.01], [[8.1, 48.0, 0.0], [208.2, 48.1, 0.0]]));
        assert!(!looks_like_degrees([1e-7, 1e-7, 0.01], [[f64::NAN; 3]; 2]));
    }

    #[test]
    fn systems_contradict_by_code_kind_or_unit_and_never_when_unknown() {
        let crs = |kind, epsg, unit| {
            Claim { kind, epsg, horizontal: Some(unit), ..Claim::default() }.into_crs(None)
        };
        let utm = crs(CrsKind::Projected, Some(25_832), 1.0);
        assert!(!utm.contradicts(&utm));
        assert!(!utm.contradicts(&Crs::unknown(LengthUnit::Auto)));
        assert!(!utm.contradicts(&crs(CrsKind::Projected, None, 1.0)));
        assert!(utm.contradicts(&crs(CrsKind::Projected, Some(25_833), 1.0)));
        assert!(utm.contradicts(&crs(CrsKind::Projected, None, FOOT)));
        assert!(utm.contradicts(&crs(CrsKind::Geographic, None, 1.0)));
    }
}
