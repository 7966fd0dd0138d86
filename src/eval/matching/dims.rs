//! Reads a label from a point record, whatever dimension and type it is stored in. The meaning of the label
//! is not known here.

use std::path::Path;

use crate::eval::error::{EvalError, Side};
use crate::input::{ExtraDimension, InputFile, RecordLayout};

/// Bytes of the user data in every point format (LAS 1.4 R15, tables 7 to 17).
const USER_DATA: usize = 17;

/// How a value is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Storage {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
    /// Some bits of a byte.
    Bits(u8),
}

impl Storage {
    /// The single types of the LAS specification, table 25.
    fn of_type(data_type: u8) -> Option<Self> {
        Some(match data_type {
            1 => Self::U8,
            2 => Self::I8,
            3 => Self::U16,
            4 => Self::I16,
            5 => Self::U32,
            6 => Self::I32,
            7 => Self::U64,
            8 => Self::I64,
            9 => Self::F32,
            10 => Self::F64,
            _ => return None,
        })
    }
}

/// A value as read. It is exact if it is stored as an integer.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Value {
    Integer(i128),
    Real(f64),
}

/// Where the labels of one file are.
#[derive(Debug, Clone)]
pub(super) struct LabelField {
    name: String,
    storage: Storage,
    offset: usize,
    /// Scale and offset of the descriptor, if it has either.
    scaling: Option<(f64, f64)>,
}

impl LabelField {
    /// Finds the dimension `name` of a file: an extra dimension, else a field of every point format.
    pub(super) fn find(file: &InputFile, side: Side, name: &str) -> Result<Self, EvalError> {
        let layout = file.layout();
        if let Some(dimension) = layout.dimension(name) {
            return Self::extra(file.path(), dimension);
        }
        Self::standard(layout, name).ok_or_else(|| EvalError::NoDimension {
            side,
            path: file.path().to_owned(),
            name: name.to_owned(),
            known: known(layout),
        })
    }

    fn extra(path: &Path, dimension: &ExtraDimension) -> Result<Self, EvalError> {
        let storage = Storage::of_type(dimension.data_type).ok_or_else(|| EvalError::DimensionType {
            path: path.to_owned(),
            name: dimension.name.clone(),
            data_type: dimension.data_type,
        })?;
        let scaled = dimension.scale.is_some() || dimension.value_offset.is_some();
        let scaling = (dimension.scale.unwrap_or(1.0), dimension.value_offset.unwrap_or(0.0));
        Ok(Self {
            name: dimension.name.clone(),
            storage,
            offset: dimension.offset,
            scaling: scaled.then_some(scaling),
        })
    }

    fn standard(layout: &RecordLayout, name: &str) -> Option<Self> {
        // The names of laspy and of PDAL.
        let (storage, offset) = match name {
            "user_data" | "UserData" => (Storage::U8, USER_DATA),
            "point_source_id" | "PointSourceId" => (Storage::U16, layout.point_source_id),
            "intensity" | "Intensity" => (Storage::U16, layout.intensity),
            "classification" | "Classification" => {
                (Storage::Bits(layout.classification_mask), layout.classification)
            }
            _ => return None,
        };
        Some(Self { name: name.to_owned(), storage, offset, scaling: None })
    }

    /// The id in a record. Zero, negative values and NaN mean no id and are read as 0.
    ///
    /// # Errors
    /// The value, if it is not a whole number or is too large.
    #[inline]
    pub(super) fn id(&self, record: &[u8]) -> Result<i64, WrongLabel> {
        if let Some(id) = self.plain(record) {
            return Ok(id.into());
        }
        match self.value(record) {
            Value::Integer(id) if id <= 0 => Ok(0),
            Value::Integer(id) => i64::try_from(id).map_err(|_| self.wrong(Value::Integer(id), ID)),
            Value::Real(value) if value.is_nan() => Ok(0),
            value @ Value::Real(_) => Ok(self.whole(value, ID)?.max(0)),
        }
    }

    /// The class code in a record.
    ///
    /// # Errors
    /// The value, if it is not a whole number from 0 to 65,535.
    #[inline]
    pub(super) fn class(&self, record: &[u8]) -> Result<u16, WrongLabel> {
        if let Some(code) = self.plain(record).and_then(|code| u16::try_from(code).ok()) {
            return Ok(code);
        }
        match self.value(record) {
            Value::Integer(code) => u16::try_from(code).map_err(|_| self.wrong(Value::Integer(code), CODE)),
            value @ Value::Real(_) => {
                u16::try_from(self.whole(value, CODE)?).map_err(|_| self.wrong(value, CODE))
            }
        }
    }

    /// The value in the storage of nearly all labels: a small unsigned integer without a scale.
    #[inline]
    fn plain(&self, record: &[u8]) -> Option<u32> {
        let at = &record[self.offset..];
        match self.storage {
            _ if self.scaling.is_some() => None,
            Storage::U8 => Some(at[0].into()),
            Storage::Bits(mask) => Some((at[0] & mask).into()),
            Storage::U16 => Some(u16::from_le_bytes(first(at)).into()),
            Storage::U32 => Some(u32::from_le_bytes(first(at))),
            _ => None,
        }
    }

    fn value(&self, record: &[u8]) -> Value {
        let at = &record[self.offset..];
        let stored = match self.storage {
            Storage::U8 => Value::Integer(at[0].into()),
            Storage::Bits(mask) => Value::Integer((at[0] & mask).into()),
            Storage::I8 => Value::Integer(i8::from_le_bytes(first(at)).into()),
            Storage::U16 => Value::Integer(u16::from_le_bytes(first(at)).into()),
            Storage::I16 => Value::Integer(i16::from_le_bytes(first(at)).into()),
            Storage::U32 => Value::Integer(u32::from_le_bytes(first(at)).into()),
            Storage::I32 => Value::Integer(i32::from_le_bytes(first(at)).into()),
            Storage::U64 => Value::Integer(u64::from_le_bytes(first(at)).into()),
            Storage::I64 => Value::Integer(i64::from_le_bytes(first(at)).into()),
            Storage::F32 => Value::Real(f32::from_le_bytes(first(at)).into()),
            Storage::F64 => Value::Real(f64::from_le_bytes(first(at))),
        };
        match (self.scaling, stored) {
            (None, _) => stored,
            (Some((scale, offset)), Value::Integer(raw)) => Value::Real(raw as f64 * scale + offset),
            (Some((scale, offset)), Value::Real(raw)) => Value::Real(raw * scale + offset),
        }
    }

    /// A whole number that was stored as a floating-point number.
    #[expect(clippy::cast_possible_truncation, reason = "the range was checked")]
    fn whole(&self, value: Value, expected: &'static str) -> Result<i64, WrongLabel> {
        /// An f64 cannot represent every whole number beyond this one.
        const LARGEST: f64 = 9_007_199_254_740_992.0;
        /// Largest difference from a whole number that counts as rounding: a scale like 0.1 does not store it
        /// exactly.
        const ROUNDING: f64 = 1e-6;
        match value {
            Value::Real(real) if real.abs() <= LARGEST && (real - real.round()).abs() <= ROUNDING => {
                Ok(real.round() as i64)
            }
            _ => Err(self.wrong(value, expected)),
        }
    }

    #[cold]
    fn wrong(&self, value: Value, expected: &'static str) -> WrongLabel {
        let value = match value {
            Value::Integer(value) => value.to_string(),
            Value::Real(value) => value.to_string(),
        };
        WrongLabel { name: self.name.clone(), value, expected }
    }
}

const ID: &str = "an id (a whole number; 0 or less means none)";
const CODE: &str = "a class code (a whole number from 0 to 65535)";

/// A value that is not a valid label.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct WrongLabel {
    name: String,
    value: String,
    expected: &'static str,
}

impl WrongLabel {
    /// The error, with the place of the record.
    pub(super) fn at(self, path: &Path, record: u64) -> EvalError {
        EvalError::Label {
            path: path.to_owned(),
            record,
            name: self.name,
            value: self.value,
            expected: self.expected,
        }
    }
}

/// The names of all dimensions that can contain labels.
fn known(layout: &RecordLayout) -> Vec<String> {
    let extra = layout.dimensions.iter().filter(|dimension| Storage::of_type(dimension.data_type).is_some());
    let standard = ["classification", "user_data", "point_source_id", "intensity"];
    extra.map(|dimension| dimension.name.clone()).chain(standard.map(str::to_owned)).collect()
}

#[inline]
fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut value = [0; N];
    value.copy_from_slice(&bytes[..N]);
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(storage: Storage, scaling: Option<(f64, f64)>) -> LabelField {
        LabelField { name: "label".into(), storage, offset: 1, scaling }
    }

    fn record(bytes: &[u8]) -> Vec<u8> {
        [&[0xff], bytes].concat()
    }

    #[test]
    fn every_type_is_read_and_what_is_not_positive_is_none() {
        for (storage, bytes, id) in [
            (Storage::U8, &[200_u8][..], 200),
            (Storage::I8, &(-3_i8).to_le_bytes(), 0),
            (Storage::U16, &60_000_u16.to_le_bytes(), 60_000),
            (Storage::I16, &(-1_i16).to_le_bytes(), 0),
            (Storage::U32, &4_000_000_000_u32.to_le_bytes(), 4_000_000_000),
            (Storage::I32, &7_i32.to_le_bytes(), 7),
            (Storage::U64, &(1_u64 << 40).to_le_bytes(), 1 << 40),
            (Storage::I64, &i64::MIN.to_le_bytes(), 0),
            (Storage::F32, &17.0_f32.to_le_bytes(), 17),
            (Storage::F32, &f32::NAN.to_le_bytes(), 0),
            (Storage::F64, &(-1.0_f64).to_le_bytes(), 0),
            (Storage::F64, &1e15_f64.to_le_bytes(), 1_000_000_000_000_000),
            (Storage::Bits(0x1f), &[0xe2], 2),
        ] {
            assert_eq!(field(storage, None).id(&record(bytes)), Ok(id), "{storage:?}");
        }
        let tenths = field(Storage::I32, Some((0.1, 2.0)));
        assert_eq!(tenths.id(&record(&30_i32.to_le_bytes())), Ok(5));
        assert!(tenths.id(&record(&31_i32.to_le_bytes())).is_err());
    }

    #[test]
    fn what_is_no_label_is_an_error() {
        assert!(field(Storage::F32, None).id(&record(&1.5_f32.to_le_bytes())).is_err());
        assert!(field(Storage::F64, None).id(&record(&f64::INFINITY.to_le_bytes())).is_err());
        assert!(field(Storage::U64, None).id(&record(&u64::MAX.to_le_bytes())).is_err());
        assert!(field(Storage::I8, None).class(&record(&(-1_i8).to_le_bytes())).is_err());
        assert!(field(Storage::U32, None).class(&record(&65_536_u32.to_le_bytes())).is_err());
        assert!(field(Storage::F32, None).class(&record(&f32::NAN.to_le_bytes())).is_err());
        assert_eq!(field(Storage::F32, None).class(&record(&8.0_f32.to_le_bytes())), Ok(8));
    }
}
