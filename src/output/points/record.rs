//! One record of a labelled copy: the original bytes, the label, the class. This module knows nothing about
//! files.

use super::descriptor::{self, Descriptors, ExtraType, OBJECT_CLASS, ORIGINAL_CLASS, ORIGINAL_CLASS_TEXT};
use super::options::LabelOptions;
use crate::config::{CLUSTER_ID, LasCodes};
use crate::input::{InputFile, RecordLayout};
use crate::model::{Hedge, Kind, PointClass};
use crate::output::error::OutputError;

/// Longest record that LAS can describe.
const MAX_RECORD: usize = u16::MAX as usize;
/// Names of dimensions that have their own meaning: the dimension of the objects has another one.
pub(crate) const RESERVED: [&str; 2] = [ORIGINAL_CLASS, OBJECT_CLASS];
/// Fields of LAS records as laspy 2 and PDAL 2 name them, in lower case and without underscores. An extra
/// dimension with such a name would hide the field, or be hidden by it.
const OF_RECORDS: &str = "x y z intensity returnnumber numberofreturns scandirectionflag edgeofflightline \
    classification rawclassification classflags synthetic keypoint withheld overlap scannerchannel \
    scanchannel scanangle scananglerank userdata pointsourceid gpstime red green blue nir infrared bitfields \
    wavepacketindex wavepacketoffset wavepacketsize returnpointwavelocation xt yt zt";

/// Whether a field of LAS records has this name.
pub(crate) fn is_field_of_records(name: &str) -> bool {
    let plain = name.replace('_', "").to_ascii_lowercase();
    OF_RECORDS.split_whitespace().any(|field| field == plain)
}

/// Number of the codes of `object_class`.
const OBJECT_CLASSES: usize = 10;
/// LAS classes of our classes (LAS 1.4 R15, tables 9 and 17).
const UNCLASSIFIED: u8 = 1;
const GROUND: u8 = 2;
const LOW_VEGETATION: u8 = 3;
const MEDIUM_VEGETATION: u8 = 4;
const HIGH_VEGETATION: u8 = 5;
const BUILDING: u8 = 6;
const WIRE: u8 = 14;
const LOW_NOISE: u8 = 7;
const HIGH_NOISE: u8 = 18;

/// How a record changes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct RecordPlan {
    input_len: usize,
    output_len: usize,
    /// Where the label goes (u32).
    label: usize,
    /// Place of the original class (u8), if it is to be kept and the input does not keep it already.
    original_class: Option<usize>,
    /// Place of the class of the object (u8), if the method classifies, or if the input has it and it does
    /// not belong to objects that the copy keeps.
    object_class: Option<usize>,
    /// Byte with the class, and the mask of its bits for the class; `None` if the class stays.
    class: Option<(usize, u8)>,
    class_byte: usize,
    class_mask: u8,
    /// LAS classes of the classes of objects, by their codes; `None` if the point keeps its class.
    objects: [Option<u8>; OBJECT_CLASSES],
    /// LAS classes of low and of higher hedges and bushes.
    hedges: [u8; 2],
    /// LAS classes that this run assigns. No other point keeps one of them.
    decided: [bool; 256],
    /// Whether the format has LAS classes above 12.
    extended: bool,
}

impl RecordPlan {
    /// The plan, and the descriptors that it needs.
    pub(super) fn new(input: &InputFile, options: &LabelOptions) -> Result<(Self, Descriptors), OutputError> {
        let layout = input.layout();
        let limit = layout.classification_mask;
        if options.set_classification
            && let Some((class, code)) = options.class_codes.largest()
            && code > limit
        {
            let (path, point_format) = (input.path().to_owned(), layout.point_format);
            return Err(OutputError::ClassCode { path, class, code, point_format, limit });
        }
        let label = existing(input, &options.dimension, ExtraType::U32)?;
        // Whatever the input calls so stays as it is, unless the class is to be kept in it.
        let keep = options.keep_original && !keeps_original(input)?;
        let mut new = Vec::new();
        // The classes of an earlier run are overwritten: a method without classes writes 0. Surfaces have a
        // dimension of their own, so the objects of that run stay, and so do their classes.
        let beside = options.surfaces && options.dimension != CLUSTER_ID;
        let classifies = !options.kinds.is_empty();
        let known = match existing(input, OBJECT_CLASS, ExtraType::U8) {
            _ if beside && !classifies => None,
            Err(_) if !classifies => None,
            known => known?,
        };
        let classify = classifies && known.is_none();
        if label.is_none() || keep || classify {
            new.extend(descriptor::undescribed(layout));
        }
        let of_label = label.map(|_| options.dimension.clone());
        let replaced = of_label.into_iter().chain(known.map(|_| OBJECT_CLASS.to_owned())).collect();
        let mut output_len = layout.record_len;
        let mut append = |name: &str, kind: ExtraType, description: &str| {
            new.push(descriptor::integer(name, kind, description));
            let at = output_len;
            output_len += usize::from(kind.bytes());
            at
        };
        let label = label.unwrap_or_else(|| {
            append(&options.dimension, ExtraType::U32, descriptor::of_label(options.surfaces))
        });
        let original_class = keep.then(|| append(ORIGINAL_CLASS, ExtraType::U8, ORIGINAL_CLASS_TEXT));
        let text = "class of the object, 0: none";
        let object_class = known.or_else(|| classify.then(|| append(OBJECT_CLASS, ExtraType::U8, text)));
        if output_len > MAX_RECORD {
            return Err(OutputError::RecordLength {
                path: input.path().to_owned(),
                length: output_len,
                limit: MAX_RECORD,
            });
        }
        let plan = Self { object_class, ..Self::with(layout, options, output_len, label, original_class) };
        Ok((plan, Descriptors { new, replaced }))
    }

    fn with(
        layout: &RecordLayout,
        options: &LabelOptions,
        output_len: usize,
        label: usize,
        original_class: Option<usize>,
    ) -> Self {
        // Formats 0 to 5 have no classes for wires and high noise: 14 and 18 are reserved in them.
        let extended = layout.point_format >= 6;
        let objects = objects(&options.class_codes, extended);
        let hedges =
            [LOW_VEGETATION, MEDIUM_VEGETATION].map(|code| options.class_codes.of_hedges().unwrap_or(code));
        let of_ground = options.finds_ground.then_some([GROUND]);
        let of_noise = options.finds_noise.then_some([LOW_NOISE, HIGH_NOISE]);
        let codes = of_ground.into_iter().flatten().chain(of_noise.into_iter().flatten());
        let of_objects = options.kinds.iter().filter_map(|kind| code_of(*kind, &objects, hedges));
        let mut decided = [false; 256];
        codes.chain(of_objects).for_each(|code| decided[usize::from(code)] = true);
        Self {
            input_len: layout.record_len,
            output_len,
            label,
            original_class,
            object_class: None,
            class: options.set_classification.then_some((layout.classification, layout.classification_mask)),
            class_byte: layout.classification,
            class_mask: layout.classification_mask,
            objects,
            hedges,
            decided,
            extended,
        }
    }

    /// Bytes of a new record.
    pub(super) fn output_len(&self) -> usize {
        self.output_len
    }

    /// Appends the new records of `records` to `out`.
    pub(super) fn label(
        &self,
        records: &[u8],
        labels: &[u32],
        classes: &[u8],
        kinds: &[Kind],
        out: &mut Vec<u8>,
    ) {
        assert_eq!(records.len(), labels.len() * self.input_len, "one label for every record");
        assert_eq!(labels.len(), classes.len(), "one class for every record");
        out.reserve(labels.len() * self.output_len);
        assert!(
            kinds.is_empty() || kinds.len() == labels.len(),
            "one kind of object for every record, or none"
        );
        let kinds = kinds.iter().copied().chain(std::iter::repeat(Kind::default()));
        let records = records.chunks_exact(self.input_len);
        for (((record, label), class), kind) in records.zip(labels).zip(classes).zip(kinds) {
            let start = out.len();
            out.extend_from_slice(record);
            out.resize(start + self.output_len, 0);
            let new = &mut out[start..];
            new[self.label..self.label + 4].copy_from_slice(&label.to_le_bytes());
            if let Some(at) = self.original_class {
                new[at] = record[self.class_byte] & self.class_mask;
            }
            if let Some(at) = self.object_class {
                new[at] = kind.class;
            }
            if let Some((at, mask)) = self.class
                && let Some(code) = self.las_class(*class, *label, kind, record[at] & mask)
            {
                new[at] = (new[at] & !mask) | code;
            }
        }
    }

    /// The LAS class for a class code and an object; `None` if the point keeps its class, `before`. No other
    /// point keeps a class that this run assigns: otherwise, every reader would take ground of an earlier run
    /// or of another program for ground of this run.
    fn las_class(&self, code: u8, label: u32, kind: Kind, before: u8) -> Option<u8> {
        let class = PointClass::from_code(code);
        if class.is_none() && label == 0 {
            return None;
        }
        // Readers skip a withheld point whatever its class is.
        match class.unwrap_or_default() {
            PointClass::Object => code_of(kind, &self.objects, self.hedges)
                .or_else(|| self.decided[usize::from(before)].then_some(UNCLASSIFIED)),
            PointClass::Ground => Some(GROUND),
            PointClass::LowNoise => Some(LOW_NOISE),
            PointClass::HighNoise => Some(if self.extended { HIGH_NOISE } else { LOW_NOISE }),
            PointClass::Withheld => None,
        }
    }
}

/// The LAS class of a kind of objects, if it has one.
fn code_of(kind: Kind, objects: &[Option<u8>; OBJECT_CLASSES], hedges: [u8; 2]) -> Option<u8> {
    match kind.hedge {
        Hedge::No => objects.get(usize::from(kind.class)).copied().flatten(),
        Hedge::Low => Some(hedges[0]),
        Hedge::Medium => Some(hedges[1]),
    }
}

/// LAS classes of the classes of objects. Vehicles, poles, fences and furniture have none unless the user
/// chose one.
fn objects(chosen: &LasCodes, extended: bool) -> [Option<u8>; OBJECT_CLASSES] {
    let mut codes = [None; OBJECT_CLASSES];
    codes[2] = Some(HIGH_VEGETATION);
    codes[5] = Some(BUILDING);
    codes[8] = extended.then_some(WIRE);
    for (code, class) in codes.iter_mut().zip(0..) {
        *code = chosen.of(class).or(*code);
    }
    codes
}

/// Whether an earlier run has kept the class of its input in this one; an error if another program has used
/// the name.
fn keeps_original(input: &InputFile) -> Result<bool, OutputError> {
    if existing(input, ORIGINAL_CLASS, ExtraType::U8)?.is_none() {
        return Ok(false);
    }
    let description = input.layout().dimension(ORIGINAL_CLASS).map(|dimension| dimension.description.clone());
    match description {
        Some(description) if description != ORIGINAL_CLASS_TEXT => Err(OutputError::DimensionOfOthers {
            path: input.path().to_owned(),
            name: ORIGINAL_CLASS,
            description,
        }),
        _ => Ok(true),
    }
}

/// Place of a dimension that an earlier run added; an error if another dimension has its name.
fn existing(input: &InputFile, name: &str, kind: ExtraType) -> Result<Option<usize>, OutputError> {
    let Some(dimension) = input.layout().dimension(name) else { return Ok(None) };
    let plain = dimension.scale.is_none() && dimension.value_offset.is_none();
    if dimension.data_type == kind as u8 && plain {
        return Ok(Some(dimension.offset));
    }
    Err(OutputError::DimensionType {
        path: input.path().to_owned(),
        name: name.to_owned(),
        data_type: dimension.data_type,
        scaled: if plain { "" } else { " with a scale" },
        expected: kind as u8,
    })
}
