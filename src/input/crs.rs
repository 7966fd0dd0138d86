//! The coordinate reference system of a file, as far as processing needs it: kind, units, name. Coordinates
//! are never transformed. The records that describe the system are copied to the output unchanged.

use super::crs_claim::{Claim, CrsKind, claim_of_keys, claim_of_wkt};
use super::crs_records::{geo_keys, wkt_text};
use super::crs_text::{code_of, with_heights};
use super::header::Header;
use super::mapped::ByteSource;
use super::projection::{Projection, definition, without_codes};
use super::unit::unit_in_words;
use super::wkt::Node;
use crate::config::LengthUnit;

/// Bit of the global encoding: the system is given as well-known text.
const WKT_BIT: u16 = 1 << 4;
/// Why a system has no name.
const NOT_UNDERSTOOD: &str = "given but not understood";

/// The coordinate reference system of a file, as far as it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Crs {
    /// The well-known text, if the file has one. If `epsg` is unknown, the text contains no code either:
    /// other programs would look the code up and ignore the rest. A text that is not understood is unchanged.
    /// If only the keys of the file describe heights, this is the text of x, y and heights together.
    pub wkt: Option<String>,
    /// Whether the file describes its system, but no record of it is understood.
    pub not_understood: bool,
    /// EPSG code of the horizontal system, if the file names one.
    pub epsg: Option<u32>,
    /// The kind of coordinates.
    pub kind: CrsKind,
    /// One unit of x and y in metres (1 if the file does not say).
    pub horizontal_unit_m: f64,
    /// One unit of z in metres (the unit of x and y if the file does not say).
    pub vertical_unit_m: f64,
    /// A readable name.
    pub description: String,
}

impl Crs {
    /// The unknown system of a drive without any record of its system, with coordinates in this unit.
    #[must_use]
    pub fn unknown(unit: LengthUnit) -> Self {
        Self::of(Claim::default(), None).nameless("not given in the files", unit)
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

    /// Whether the texts show different projections. With equal codes they are the same. An unreadable text
    /// shows no difference.
    fn projections_differ(&self, other: &Self) -> bool {
        if self.epsg.is_some() && other.epsg.is_some() {
            return false;
        }
        let [first, second] = [self, other].map(|crs| crs.text().and_then(Projection::of));
        matches!((first, second), (Some(first), Some(second)) if first.differs_from(&second))
    }

    /// The system of coordinates whose units are stated in the settings, `unit_m` metres in x, y and z. If
    /// the records contradict it, they do not describe these coordinates, and the outputs do not name their
    /// system.
    pub(super) fn with_stated_unit(self, unit_m: f64, warnings: &mut Vec<String>) -> Self {
        if !self.is_known() {
            return Self { horizontal_unit_m: unit_m, vertical_unit_m: unit_m, ..self };
        }
        let same = |own: f64| (unit_m / own - 1.0).abs() <= 1e-6;
        let is_other_kind = matches!(self.kind, CrsKind::Geographic | CrsKind::Geocentric);
        let stated = unit_in_words(unit_m);
        if is_other_kind || !same(self.horizontal_unit_m) {
            let own = match self.kind {
                CrsKind::Geographic => "degrees".to_owned(),
                CrsKind::Geocentric => "metres from the centre of the earth".to_owned(),
                CrsKind::Projected | CrsKind::Unknown => unit_in_words(self.horizontal_unit_m),
            };
            warnings.push(format!(
                "input.unit says that coordinates are in {stated}, but those of {} are in {own}: the tables do not name \
                 this system",
                self.description
            ));
            let description = format!("{}, but in {stated}", self.description);
            let (horizontal_unit_m, vertical_unit_m) = (unit_m, unit_m);
            let kind = CrsKind::Unknown;
            return Self {
                wkt: None,
                epsg: None,
                kind,
                horizontal_unit_m,
                vertical_unit_m,
                description,
                ..self
            };
        }
        if same(self.vertical_unit_m) {
            return self;
        }
        warnings.push(format!(
            "input.unit says that heights are in {stated}, but those of {} are in {}: the tables do not have the text of \
             this system",
            self.description,
            unit_in_words(self.vertical_unit_m)
        ));
        Self { wkt: None, vertical_unit_m: unit_m, ..self }
    }

    /// Well-known text for an output: that of the file, or that of the EPSG dataset for its codes.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        self.wkt.as_deref().or_else(|| definition(self.epsg?))
    }

    /// EPSG code of all that [`Self::text`] describes, which may be more than the horizontal system.
    #[must_use]
    pub fn text_epsg(&self) -> Option<u32> {
        self.wkt.as_deref().map_or(self.epsg, |text| code_of(text, self.epsg))
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
        let from_keys = keys.ok().flatten().and_then(|keys| claim_of_keys(&keys, warnings));
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
            .compared_with_epsg(warnings)
            .with_unit_of_heights();
        let text = text.filter(|_| claim != Claim::default());
        let text = text.map(|text| if claim.epsg.is_none() { without_codes(text) } else { text });
        claim.warn_about_unit(warnings);
        let with_heights = with_heights(text.as_deref(), &claim);
        let crs = Self::of(claim, text);
        Self { wkt: with_heights.or(crs.wkt), ..crs }
    }

    /// The system of a file whose records are not understood. Outputs keep the text as it is.
    fn only_odd(text: Option<String>, records: &str, warnings: &mut Vec<String>) -> Self {
        let kept = if text.is_some() { ", and objects.gpkg gets the text" } else { "" };
        warnings.push(format!(
            "the coordinate system is given but not understood ({records}): copies keep it as it is{kept}; write it again \
             with the program that made the file, and set input.unit if coordinates are not in metres"
        ));
        let crs = Self { not_understood: true, ..Self::of(Claim::default(), text) };
        crs.in_unit(LengthUnit::Auto)
    }

    /// The system that a claim describes, with its well-known text.
    fn of(claim: Claim, wkt: Option<String>) -> Self {
        let [horizontal_unit_m, vertical_unit_m] = claim.units_m();
        // A system without a name is called by the code of x and y.
        let named = claim.name.as_ref().and(wkt.as_deref());
        let code = named.map_or(claim.epsg, |text| code_of(text, claim.epsg));
        let description = match (&claim.name, code) {
            (Some(name), Some(code)) => format!("{name} (EPSG:{code})"),
            (Some(name), None) => name.clone(),
            (None, Some(code)) => format!("EPSG:{code}"),
            (None, None) => match claim.kind {
                CrsKind::Projected => "an unnamed projected system".into(),
                CrsKind::Geographic => "an unnamed geographic system".into(),
                CrsKind::Geocentric => "an unnamed geocentric system".into(),
                CrsKind::Unknown => "not given in the files (coordinates are taken as metres)".into(),
            },
        };
        Self {
            wkt,
            not_understood: false,
            epsg: claim.epsg,
            kind: claim.kind,
            horizontal_unit_m,
            vertical_unit_m,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{FOOT, US_SURVEY_FOOT};

    #[test]
    fn a_code_without_text_has_that_of_the_epsg_dataset() {
        let claim = Claim { epsg: Some(32_632), kind: CrsKind::Projected, ..Claim::default() };
        let text = Crs::of(claim.clone(), None).text().map(str::to_owned).expect("a text");
        assert!(text.starts_with("PROJCS[\"WGS 84 / UTM zone 32N\""), "{text}");
        assert_eq!(Crs::of(claim.clone(), Some("its own".to_owned())).text(), Some("its own"));
        assert_eq!(Crs::of(Claim { epsg: Some(999_999), ..claim }, None).text(), None);
    }

    #[test]
    fn a_stated_unit_that_contradicts_the_record_takes_its_name_from_the_outputs() {
        let crs = |kind, vertical| {
            let claim = Claim {
                epsg: Some(2255),
                kind,
                horizontal: Some(US_SURVEY_FOOT),
                vertical,
                ..Claim::default()
            };
            Crs::of(claim, Some("text".to_owned()))
        };
        let stated = |crs: Crs, unit_m: f64| {
            let mut warnings = Vec::new();
            let crs = crs.with_stated_unit(unit_m, &mut warnings);
            assert_eq!((crs.horizontal_unit_m, crs.vertical_unit_m), (unit_m, unit_m));
            (crs.epsg, crs.wkt.is_some(), warnings)
        };
        let (projected, feet) = (CrsKind::Projected, US_SURVEY_FOOT);
        assert_eq!(stated(crs(projected, None), feet), (Some(2255), true, Vec::new()));
        assert_eq!(stated(Crs::unknown(LengthUnit::Foot), FOOT), (None, false, Vec::new()));
        for (crs, unit_m, expected) in [
            (
                crs(projected, None),
                1.0,
                "input.unit says that coordinates are in metres, but those of EPSG:2255 are in US survey feet: the \
                 tables do not name this system",
            ),
            (
                crs(CrsKind::Geographic, None),
                1.0,
                "input.unit says that coordinates are in metres, but those of EPSG:2255 are in degrees: the tables do \
                 not name this system",
            ),
        ] {
            assert_eq!(stated(crs, unit_m), (None, false, vec![expected.to_owned()]));
        }
        let heights = "input.unit says that heights are in US survey feet, but those of EPSG:2255 are in metres: the \
                       tables do not have the text of this system";
        assert_eq!(stated(crs(projected, Some(1.0)), feet), (Some(2255), false, vec![heights.to_owned()]));
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
            Crs::of(Claim { kind, epsg, horizontal: Some(unit), ..Claim::default() }, None)
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
