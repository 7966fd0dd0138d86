//! Well-known text of all that the records of a file say together. A text of x and y alone is completed by
//! the heights, because its readers take heights to be in the unit of x and y.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use super::crs_claim::Claim;
use super::epsg_units::unit_of_vertical_system;
use super::projection::definition;
use super::wkt::{Node, node_text};
use crate::config::{FOOT, US_SURVEY_FOOT};

/// Units that the texts name: metres, name and EPSG code.
const UNITS: [(f64, &str, u32); 3] =
    [(1.0, "metre", 9001), (FOOT, "foot", 9002), (US_SURVEY_FOOT, "US survey foot", 9003)];

/// Texts of vertical systems by their codes, from the compound systems of the EPSG dataset. Those with an
/// extension are left out: it names grids of one release of PROJ.
static VERTICAL_SYSTEMS: LazyLock<BTreeMap<u32, &'static str>> = LazyLock::new(|| {
    let compound = |code| definition(code).filter(|text| text.starts_with("COMPD_CS["));
    (0..=u32::from(u16::MAX))
        .filter_map(compound)
        .filter_map(|text| node_text(text, "VERT_CS"))
        .filter(|text| !text.contains("EXTENSION["))
        .filter_map(|text| Some((Node::parse(text)?.epsg()?, text)))
        .collect()
});

/// The text of a compound system: that of x and y, which is `text` or else the definition of the code, and
/// the heights of the claim. `None` if the text of x and y serves as it is: no heights are known, or `text`
/// is of the file and heights have the unit of x and y. Texts of other kinds than `PROJCS` also serve.
pub(super) fn with_heights(text: Option<&str>, claim: &Claim) -> Option<String> {
    let [horizontal_m, vertical_m] = claim.units_m();
    let of_unit = |code: &u32| unit_of_vertical_system(*code).is_some_and(|own| same(own, vertical_m));
    // A code whose unit differs from that of the heights is not their system.
    let code = claim.vertical_code.filter(of_unit);
    if same(horizontal_m, vertical_m) && (code.is_none() || text.is_some()) {
        return None;
    }
    let plane = text.or_else(|| definition(claim.epsg?))?;
    let root = Node::parse(plane).filter(|root| root.keyword == "PROJCS")?;
    let vertical = vertical_text(code, vertical_m);
    let heights = Node::parse(&vertical)?;
    let name = format!("{} + {}", root.name()?, heights.name()?).replace('"', "\"\"");
    Some(format!("COMPD_CS[\"{name}\",{},{vertical}]", node_text(plane, "PROJCS")?))
}

/// The code of all that a text describes, `horizontal` being that of x and y. A compound or bound system is
/// more than its horizontal part, and programs that know a code do not read the text beside it.
pub(super) fn code_of(text: &str, horizontal: Option<u32>) -> Option<u32> {
    let root = Node::parse(text)?;
    match root.keyword.as_str() {
        "COMPD_CS" | "COMPOUNDCRS" | "BOUNDCRS" => root.epsg().filter(|code| definition(*code).is_some()),
        _ => horizontal,
    }
}

/// The text of a vertical system: that of the EPSG dataset, or its unit and its code, if it has one.
fn vertical_text(code: Option<u32>, unit_m: f64) -> String {
    if let Some(text) = code.and_then(|code| VERTICAL_SYSTEMS.get(&code)) {
        return (*text).to_owned();
    }
    let unit = UNITS.iter().find(|(known, ..)| same(*known, unit_m)).map_or_else(
        || format!("UNIT[\"unknown\",{unit_m}]"),
        |(metres, name, code)| format!("UNIT[\"{name}\",{metres},AUTHORITY[\"EPSG\",\"{code}\"]]"),
    );
    let name = code.map_or_else(|| "unknown".to_owned(), |code| format!("EPSG:{code}"));
    let authority = code.map(|code| format!(",AUTHORITY[\"EPSG\",\"{code}\"]")).unwrap_or_default();
    format!("VERT_CS[\"{name}\",VERT_DATUM[\"unknown\",2005],{unit},AXIS[\"Up\",UP]{authority}]")
}

/// Whether two units are the same but for their digits in files.
fn same(one_m: f64, other_m: f64) -> bool {
    (one_m / other_m - 1.0).abs() < 1e-7
}

#[cfg(test)]
mod tests {
    use super::super::crs_claim::{CrsKind, claim_of_wkt};
    use super::*;

    fn keys(epsg: u32, horizontal: f64, vertical_code: Option<u32>, vertical: Option<f64>) -> Claim {
        let claim = Claim {
            epsg: Some(epsg),
            kind: CrsKind::Projected,
            horizontal: Some(horizontal),
            vertical,
            vertical_code,
            name: None,
        };
        claim.with_unit_of_heights()
    }

    /// The name of the vertical part, and the code and the units of x, y and heights that are read back.
    fn read_back(text: &str) -> (String, Option<u32>, [f64; 2]) {
        let root = Node::parse(text).expect("a text");
        let vertical = root.child(&["VERT_CS"]).and_then(Node::name).expect("a vertical part").to_owned();
        let claim = claim_of_wkt(&root).expect("a system").with_unit_of_heights();
        (vertical, claim.epsg, claim.units_m())
    }

    #[test]
    fn heights_of_keys_are_in_the_text_and_are_read_back() {
        let (utm, new_york) = (26_918, 2_263);
        for (claim, name) in [
            (keys(utm, 1.0, Some(6360), Some(US_SURVEY_FOOT)), "NAVD88 height (ftUS)"),
            (keys(utm, 1.0, Some(8228), None), "NAVD88 height (ft)"),
            (keys(utm, 1.0, Some(5703), None), "NAVD88 height"),
            (keys(new_york, US_SURVEY_FOOT, Some(5703), Some(1.0)), "NAVD88 height"),
            // DHHN2016 is in no compound system of the dataset.
            (keys(25_832, 1.0, Some(7837), None), "EPSG:7837"),
            (keys(utm, 1.0, None, Some(US_SURVEY_FOOT)), "unknown"),
            (keys(utm, 1.0, None, Some(0.914_398)), "unknown"),
            // The datum of NAVD88, and a system in feet under a unit of its own.
            (keys(utm, 1.0, Some(5103), Some(FOOT)), "unknown"),
            (keys(new_york, US_SURVEY_FOOT, Some(8228), Some(1.0)), "unknown"),
        ] {
            let text = with_heights(None, &claim).expect("a text with heights");
            assert_eq!(read_back(&text), (name.to_owned(), claim.epsg, claim.units_m()), "{text}");
        }
        let text = with_heights(None, &keys(utm, 1.0, Some(6360), None)).expect("a text with heights");
        assert!(
            text.starts_with("COMPD_CS[\"NAD83 / UTM zone 18N + NAVD88 height (ftUS)\",PROJCS["),
            "{text}"
        );
    }

    #[test]
    fn a_text_that_tells_the_unit_of_heights_serves_as_it_is() {
        let utm = 26_918;
        for claim in [
            keys(utm, 1.0, None, None),
            keys(utm, 1.0, None, Some(1.0)),
            keys(utm, 1.0, Some(5103), None),
            // No definition, or one of two parts.
            keys(65_000, 1.0, Some(5703), None),
            keys(5_555, 1.0, Some(5703), None),
        ] {
            assert_eq!(with_heights(None, &claim), None, "{claim:?}");
        }
        // The text of a file changes only if heights would be misread.
        let site = "PROJCS[\"the \"\"site\"\"\",UNIT[\"metre\",1]]";
        assert_eq!(with_heights(Some(site), &keys(utm, 1.0, Some(5703), None)), None);
        let text = with_heights(Some(&format!("{site}\0 ")), &keys(utm, 1.0, None, Some(FOOT)));
        assert_eq!(
            text.as_deref(),
            Some(
                "COMPD_CS[\"the \"\"site\"\" + unknown\",PROJCS[\"the \"\"site\"\"\",UNIT[\"metre\",1]],\
                 VERT_CS[\"unknown\",VERT_DATUM[\"unknown\",2005],UNIT[\"foot\",0.3048,AUTHORITY[\"EPSG\",\"9002\"]],\
                 AXIS[\"Up\",UP]]]"
            )
        );
    }

    #[test]
    fn a_text_has_the_code_of_its_outermost_system() {
        let plane = "PROJCS[\"p\",UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"25832\"]]";
        let compound = |end: &str| format!("COMPD_CS[\"c\",{plane},VERT_CS[\"v\",UNIT[\"metre\",1]]{end}]");
        for (text, code) in [
            (plane.to_owned(), Some(25_832)),
            // The code is in the keys.
            ("PROJCS[\"p\",UNIT[\"metre\",1]]".to_owned(), Some(25_832)),
            (compound(""), None),
            (compound(",AUTHORITY[\"EPSG\",\"5555\"]"), Some(5_555)),
            // No code of the dataset.
            (compound(",AUTHORITY[\"EPSG\",\"65000\"]"), None),
            ("COMPOUNDCRS[\"c\",PROJCRS[\"p\"],VERTCRS[\"v\"],ID[\"EPSG\",7415]]".to_owned(), Some(7_415)),
            (format!("BOUNDCRS[SOURCECRS[{plane}],TARGETCRS[GEOGCRS[\"w\",ID[\"EPSG\",4326]]]]"), None),
        ] {
            assert_eq!(code_of(&text, Some(25_832)), code, "{text}");
        }
    }

    #[test]
    fn vertical_systems_of_the_dataset_have_the_units_of_their_codes() {
        assert!(VERTICAL_SYSTEMS.len() > 30, "{}", VERTICAL_SYSTEMS.len());
        for (code, vertical) in VERTICAL_SYSTEMS.iter() {
            let plane = "PROJCS[\"p\",UNIT[\"x\",2]]";
            let (_, _, [_, unit_m]) = read_back(&format!("COMPD_CS[\"c\",{plane},{vertical}]"));
            assert!(unit_of_vertical_system(*code).is_some_and(|own| same(own, unit_m)), "{code}: {unit_m}");
        }
    }
}
