//! Units of length by their codes in the EPSG dataset: of units themselves, and of vertical systems.
//!
//! Source of both tables: EPSG dataset 11.022, read with pyproj 3.7.2 (`query_crs_info` with deprecated
//! codes, and the table `unit_of_measure` of its `proj.db`). The crate `crs-definitions` has no vertical
//! systems.

use crate::config::{FOOT, US_SURVEY_FOOT};

/// Metres of the other units of length, in ascending code. Rates and bin widths are left out.
const OTHER_UNITS: [(u16, f64); 44] = [
    (1025, 0.001),                    // millimetre
    (1033, 0.01),                     // centimetre
    (9005, 0.304_797_265_4),          // Clarke's foot
    (9014, 1.8288),                   // fathom
    (9030, 1852.0),                   // nautical mile
    (9031, 1.000_013_596_5),          // German legal metre
    (9033, 20.116_840_233_680_47),    // US survey chain
    (9034, 0.201_168_402_336_804_7),  // US survey link
    (9035, 1_609.347_218_694_437_5),  // US survey mile
    (9036, 1000.0),                   // kilometre
    (9037, 0.914_391_796_2),          // Clarke's yard
    (9038, 20.116_619_516_4),         // Clarke's chain
    (9039, 0.201_166_195_164),        // Clarke's link
    (9040, 0.914_398_414_616_028_7),  // British yard (Sears 1922)
    (9041, 0.304_799_471_538_676_2),  // British foot (Sears 1922)
    (9042, 20.116_765_121_552_632),   // British chain (Sears 1922)
    (9043, 0.201_167_651_215_526_3),  // British link (Sears 1922)
    (9050, 0.914_399_2),              // British yard (Benoit 1895 A)
    (9051, 0.304_799_733_333_333_3),  // British foot (Benoit 1895 A)
    (9052, 20.116_782_4),             // British chain (Benoit 1895 A)
    (9053, 0.201_167_824),            // British link (Benoit 1895 A)
    (9060, 0.914_399_204_289_812_4),  // British yard (Benoit 1895 B)
    (9061, 0.304_799_734_763_270_77), // British foot (Benoit 1895 B)
    (9062, 20.116_782_494_375_872),   // British chain (Benoit 1895 B)
    (9063, 0.201_167_824_943_758_7),  // British link (Benoit 1895 B)
    (9070, 0.304_800_833_333_333_35), // British foot (1865)
    (9080, 0.304_799_510_248_146_94), // Indian foot
    (9081, 0.304_798_41),             // Indian foot (1937)
    (9082, 0.304_799_6),              // Indian foot (1962)
    (9083, 0.304_799_5),              // Indian foot (1975)
    (9084, 0.914_398_530_744_440_8),  // Indian yard
    (9085, 0.914_395_23),             // Indian yard (1937)
    (9086, 0.914_398_8),              // Indian yard (1962)
    (9087, 0.914_398_5),              // Indian yard (1975)
    (9093, 1_609.344),                // Statute mile
    (9094, 0.304_799_710_181_508_8),  // Gold Coast foot
    (9095, 0.304_800_749_1),          // British foot (1936)
    (9096, 0.9144),                   // yard
    (9097, 20.1168),                  // chain
    (9098, 0.201_168),                // link
    (9099, 0.914_398),                // British yard (Sears 1922 truncated)
    (9300, 0.304_799_333_333_333_37), // British foot (Sears 1922 truncated)
    (9301, 20.116_756),               // British chain (Sears 1922 truncated)
    (9302, 0.201_167_56),             // British link (Sears 1922 truncated)
];

/// Vertical systems whose unit is not the metre: NGVD29, NAVD88, mean sea level, the Cayman Islands, Ireland,
/// Kuwait. Their metres.
const VERTICAL_NOT_IN_METRES: [(u32, f64); 15] = [
    (5614, FOOT),
    (5702, US_SURVEY_FOOT),
    (5754, 0.304_800_749_1),
    (6130, FOOT),
    (6131, FOOT),
    (6132, FOOT),
    (6358, US_SURVEY_FOOT),
    (6359, US_SURVEY_FOOT),
    (6360, US_SURVEY_FOOT),
    (8050, FOOT),
    (8051, FOOT),
    (8052, US_SURVEY_FOOT),
    (8053, US_SURVEY_FOOT),
    (8228, FOOT),
    (8897, FOOT),
];

/// Vertical systems in metres: the first and the last code of every range without a gap, ascending.
const VERTICAL_IN_METRES: [(u32, u32); 91] = [
    (3855, 3855),
    (3886, 3886),
    (3900, 3900),
    (4440, 4440),
    (4458, 4458),
    (5193, 5193),
    (5195, 5195),
    (5214, 5214),
    (5237, 5237),
    (5317, 5317),
    (5336, 5336),
    (5597, 5597),
    (5600, 5613),
    (5615, 5621),
    (5701, 5701),
    (5703, 5706),
    (5709, 5753),
    (5755, 5799),
    (5829, 5829),
    (5831, 5831),
    (5843, 5843),
    (5861, 5874),
    (5941, 5941),
    (6178, 6187),
    (6357, 6357),
    (6638, 6644),
    (6647, 6647),
    (6693, 6695),
    (6916, 6916),
    (7446, 7447),
    (7651, 7652),
    (7699, 7700),
    (7707, 7707),
    (7832, 7832),
    (7837, 7837),
    (7839, 7839),
    (7841, 7841),
    (7888, 7890),
    (7962, 7962),
    (7968, 7968),
    (7976, 7976),
    (7979, 7979),
    (8089, 8089),
    (8266, 8267),
    (8357, 8358),
    (8378, 8378),
    (8434, 8434),
    (8675, 8675),
    (8690, 8691),
    (8841, 8841),
    (8881, 8881),
    (8904, 8904),
    (8911, 8911),
    (9130, 9130),
    (9245, 9245),
    (9255, 9255),
    (9274, 9274),
    (9279, 9279),
    (9287, 9288),
    (9303, 9303),
    (9335, 9335),
    (9351, 9351),
    (9389, 9390),
    (9392, 9402),
    (9451, 9451),
    (9458, 9458),
    (9471, 9471),
    (9650, 9651),
    (9663, 9663),
    (9666, 9666),
    (9669, 9669),
    (9672, 9672),
    (9675, 9675),
    (9681, 9681),
    (9721, 9722),
    (9923, 9923),
    (9927, 9927),
    (10_150, 10_151),
    (10_190, 10_190),
    (10_349, 10_349),
    (10_352, 10_354),
    (10_364, 10_364),
    (10_370, 10_379),
    (10_482, 10_485),
    (10_547, 10_552),
    (10_565, 10_565),
    (10_588, 10_588),
    (10_649, 10_650),
    (10_678, 10_678),
    (20_000, 20_000),
    (20_034, 20_036),
];

/// Metres of a unit of length by its EPSG code; `None` if it is no such unit.
pub(super) fn unit_of_code(code: u16) -> Option<f64> {
    match code {
        9001 => Some(1.0),
        9002 => Some(FOOT),
        9003 => Some(US_SURVEY_FOOT),
        _ => OTHER_UNITS.iter().find(|(known, _)| *known == code).map(|(_, metres)| *metres),
    }
}

/// Metres of the unit of heights in a vertical system by its EPSG code; `None` if it is no such system.
pub(super) fn unit_of_vertical_system(code: u32) -> Option<f64> {
    let other = VERTICAL_NOT_IN_METRES.iter().find(|(known, _)| *known == code).map(|(_, metres)| *metres);
    let metres = VERTICAL_IN_METRES.iter().any(|(first, last)| (*first..=*last).contains(&code));
    other.or_else(|| metres.then_some(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_by_their_codes() {
        let found = [9001, 9002, 9003, 9005, 9036, 32_767, 9102].map(unit_of_code);
        let expected = [
            Some(1.0),
            Some(FOOT),
            Some(US_SURVEY_FOOT),
            Some(0.304_797_265_4),
            Some(1_000.0),
            None,
            // A degree.
            None,
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn vertical_systems_have_the_units_of_the_dataset() {
        // NAVD88 in metres, US survey feet and feet; EGM2008; the datum of NAVD88; no system.
        let found = [5703, 6360, 8228, 3855, 5103, 32_767].map(unit_of_vertical_system);
        assert_eq!(found, [Some(1.0), Some(US_SURVEY_FOOT), Some(FOOT), Some(1.0), None, None]);
        let both = VERTICAL_NOT_IN_METRES.iter().filter(|(code, _)| {
            VERTICAL_IN_METRES.iter().any(|(first, last)| (*first..=*last).contains(code))
        });
        assert_eq!(both.count(), 0, "a system has one unit");
    }
}
