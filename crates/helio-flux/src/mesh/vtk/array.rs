//! Arrays of numbers of the types that VTK has.

/// The type of an array's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// A number as it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Number {
    Whole(i64),
    Real(f64),
}

impl Number {
    pub(super) fn real(self) -> f64 {
        match self {
            Self::Whole(value) => value as f64,
            Self::Real(value) => value,
        }
    }

    /// A place in an array: a whole number not below zero.
    pub(super) fn place(self) -> Option<u64> {
        match self {
            Self::Whole(value) => u64::try_from(value).ok(),
            Self::Real(_) => None,
        }
    }
}

impl Kind {
    /// By its name in a legacy file; `vtkIdType` is written as 32 bits there.
    pub(super) fn legacy(name: &[u8]) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"char" | b"signed_char" => Self::I8,
            b"unsigned_char" => Self::U8,
            b"short" => Self::I16,
            b"unsigned_short" => Self::U16,
            b"int" | b"vtkidtype" => Self::I32,
            b"unsigned_int" => Self::U32,
            b"long" | b"vtktypeint64" => Self::I64,
            b"unsigned_long" | b"vtktypeuint64" => Self::U64,
            b"float" => Self::F32,
            b"double" => Self::F64,
            _ => return None,
        })
    }

    /// By its name in an XML file.
    pub(super) fn xml(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"Int8" => Self::I8,
            b"UInt8" => Self::U8,
            b"Int16" => Self::I16,
            b"UInt16" => Self::U16,
            b"Int32" => Self::I32,
            b"UInt32" => Self::U32,
            b"Int64" => Self::I64,
            b"UInt64" => Self::U64,
            b"Float32" => Self::F32,
            b"Float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) const fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(super) const fn is_whole(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// From its bytes, as many as [`bytes`](Self::bytes), lowest first.
    pub(super) fn number(self, bytes: &[u8]) -> Number {
        let mut wide = [0; 8];
        wide[..bytes.len()].copy_from_slice(bytes);
        let bits = u64::from_le_bytes(wide);
        match self {
            Self::I8 => Number::Whole(i64::from(bits as i8)),
            Self::I16 => Number::Whole(i64::from(bits as i16)),
            Self::I32 => Number::Whole(i64::from(bits as i32)),
            Self::I64 => Number::Whole(bits as i64),
            // What is beyond any place is below zero.
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => Number::Whole(bits as i64),
            Self::F32 => Number::Real(f64::from(f32::from_bits(bits as u32))),
            Self::F64 => Number::Real(f64::from_bits(bits)),
        }
    }

    /// From a word of text.
    pub(super) fn word(self, word: &[u8]) -> Option<Number> {
        if self.is_whole() {
            let word = std::str::from_utf8(word).ok()?;
            return word.parse().ok().map(Number::Whole);
        }
        crate::mesh::text::number(word).map(Number::Real)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_and_words_are_the_same_numbers() {
        assert_eq!(Kind::I8.number(&[0xff]), Number::Whole(-1));
        assert_eq!(Kind::U8.number(&[0xff]), Number::Whole(255));
        assert_eq!(Kind::I32.number(&(-7_i32).to_le_bytes()), Number::Whole(-7));
        assert_eq!(Kind::F32.number(&0.5_f32.to_le_bytes()), Number::Real(0.5));
        assert_eq!(
            Kind::F64.number(&(-2.25_f64).to_le_bytes()),
            Number::Real(-2.25)
        );
        assert_eq!(Kind::I32.word(b"-7"), Some(Number::Whole(-7)));
        assert_eq!(Kind::I32.word(b"7.5"), None);
        assert_eq!(Kind::F64.word(b"1e3"), Some(Number::Real(1000.0)));
        assert_eq!(Number::Whole(-1).place(), None);
        assert_eq!(Kind::legacy(b"vtktypeint64"), Some(Kind::I64));
        assert_eq!(Kind::legacy(b"string"), None);
    }
}
