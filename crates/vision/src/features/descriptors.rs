//! Descriptors of one image, stored as the rows of one matrix: real values ([`FloatRows`]) or bits
//! ([`BinaryRows`]).

use std::fmt;

use crate::simd::Prepared;

/// Type and length of a descriptor; it decides how two of them are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum DescriptorKind {
    /// Real values, compared by Euclidean distance.
    Float {
        /// Number of values.
        dim: usize,
    },
    /// Bits, compared by Hamming distance.
    Binary {
        /// Number of bits.
        bits: usize,
    },
}

impl fmt::Display for DescriptorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Float { dim } => write!(f, "{dim} values"),
            Self::Binary { bits } => write!(f, "{bits} bits"),
        }
    }
}

/// The descriptors of one image.
#[derive(Clone, Debug, PartialEq)]
pub enum Descriptors {
    /// Real-valued descriptors (SIFT, SURF, KAZE ...).
    Float(FloatRows),
    /// Binary descriptors (ORB, BRISK, AKAZE ...).
    Binary(BinaryRows),
}

impl Descriptors {
    /// No descriptors of the given kind.
    pub fn empty(kind: DescriptorKind) -> Self {
        match kind {
            DescriptorKind::Float { dim } => Self::Float(FloatRows::new(dim)),
            DescriptorKind::Binary { bits } => Self::Binary(BinaryRows::new(bits)),
        }
    }

    /// Type and length.
    pub fn kind(&self) -> DescriptorKind {
        match self {
            Self::Float(rows) => DescriptorKind::Float { dim: rows.dim() },
            Self::Binary(rows) => DescriptorKind::Binary { bits: rows.bits() },
        }
    }

    /// Number of descriptors.
    pub fn len(&self) -> usize {
        match self {
            Self::Float(rows) => rows.len(),
            Self::Binary(rows) => rows.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Those at `indices`, in that order.
    ///
    /// # Panics
    /// If there is no descriptor at one of them.
    #[must_use]
    pub fn select(&self, indices: impl IntoIterator<Item = usize>) -> Self {
        let mut selected = Self::empty(self.kind());
        for index in indices {
            selected.push_from(self, index);
        }
        selected
    }

    /// Appends the descriptor of `other` at `index`.
    ///
    /// # Panics
    /// If `other` is of another kind, or has none there.
    pub fn push_from(&mut self, other: &Self, index: usize) {
        match (self, other) {
            (Self::Float(rows), Self::Float(other)) => rows.push(other.row(index)),
            (Self::Binary(rows), Self::Binary(other)) => rows.push(other.row(index)),
            _ => panic!("descriptors of one kind"),
        }
    }
}

/// Real-valued descriptors of `dim` values each, row after row.
#[derive(Clone, Debug, PartialEq)]
pub struct FloatRows {
    dim: usize,
    data: Vec<f32>,
    prepared: Prepared,
}

impl FloatRows {
    /// No rows, of `dim` values each.
    ///
    /// # Panics
    /// If `dim` is 0.
    pub fn new(dim: usize) -> Self {
        Self::from_vec(dim, Vec::new())
    }

    /// Rows of `dim` values over `data`.
    ///
    /// # Panics
    /// If `dim` is 0 or does not divide the length of `data`.
    pub fn from_vec(dim: usize, data: Vec<f32>) -> Self {
        assert!(
            dim > 0 && data.len().is_multiple_of(dim),
            "{} values in rows of {dim}",
            data.len()
        );
        Self {
            dim,
            data,
            prepared: Prepared::default(),
        }
    }

    /// The largest magnitude of the values of rows of `dim` with which every squared distance is finite: that of opposite
    /// rows is `4 dim` times its square, and sums that are rounded may be as much again.
    pub fn largest_value(dim: usize) -> f32 {
        (f32::MAX / 8.0 / dim as f32).sqrt()
    }

    /// Values in a row.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.data.len() / self.dim
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    /// Row `index`.
    pub fn row(&self, index: usize) -> &[f32] {
        &self.data[index * self.dim..][..self.dim]
    }

    /// All values, row after row.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// All values, row after row, to be used for something else.
    pub(crate) fn into_vec(self) -> Vec<f32> {
        self.data
    }

    /// About how much memory the rows take, in bytes, together with what searches among them keep for the next
    /// ones, at most.
    pub fn memory(&self) -> usize {
        size_of_val(self.data()) + Prepared::most_bytes(self.len(), self.dim)
    }

    /// What searches among these rows keep.
    pub(crate) fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    /// Appends a row.
    ///
    /// # Panics
    /// If `row` does not have [`FloatRows::dim`] values.
    pub fn push(&mut self, row: &[f32]) {
        assert_eq!(row.len(), self.dim, "a row has {} values", self.dim);
        self.prepared = Prepared::default();
        self.data.extend_from_slice(row);
    }
}

/// Binary descriptors of `bits` bits each, row after row, each padded with zeros to whole 64-bit
/// words. Bit `i` of a row is bit `i % 64` (from the least significant) of word `i / 64`.
#[derive(Clone, Debug, PartialEq)]
pub struct BinaryRows {
    bits: usize,
    data: Vec<u64>,
}

impl BinaryRows {
    /// No rows, of `bits` bits each.
    ///
    /// # Panics
    /// If `bits` is 0.
    pub fn new(bits: usize) -> Self {
        Self::from_vec(bits, Vec::new())
    }

    /// Rows of `bits` bits over `data`. What is set beyond them in the last word of a row is cleared.
    ///
    /// # Panics
    /// If `bits` is 0 or its number of words does not divide the length of `data`.
    pub fn from_vec(bits: usize, data: Vec<u64>) -> Self {
        let mut rows = Self { bits, data };
        assert!(
            bits > 0 && rows.data.len().is_multiple_of(rows.words()),
            "{} words in rows of {bits} bits",
            rows.data.len()
        );
        rows.clear_padding(0);
        rows
    }

    /// Rows of `bits` bits over bytes, each row padded to whole bytes. Bit `i` of a row is bit `i % 8` (from the
    /// least significant) of byte `i / 8`, as the bytes of a word are stored. What is set beyond the bits of a row is
    /// cleared.
    ///
    /// # Panics
    /// If `bits` is 0 or its number of bytes does not divide the length of `bytes`.
    pub fn from_bytes(bits: usize, bytes: &[u8]) -> Self {
        let mut rows = Self::new(bits);
        assert!(
            bytes.len().is_multiple_of(rows.bytes()),
            "{} bytes in rows of {bits} bits",
            bytes.len()
        );
        rows.data
            .reserve_exact(bytes.len() / rows.bytes() * rows.words());
        for row in bytes.chunks_exact(rows.bytes()) {
            rows.push_bytes(row);
        }
        rows
    }

    /// All rows, one after the other, in the form that [`BinaryRows::from_bytes`] reads.
    pub fn to_bytes(&self) -> Vec<u8> {
        let rows = self.data.chunks_exact(self.words());
        rows.flat_map(|row| {
            let bytes = row.iter().flat_map(|word| word.to_le_bytes());
            bytes.take(self.bytes())
        })
        .collect()
    }

    /// Clears what is set beyond the bits of the rows from `first` on, since searches compare whole words.
    fn clear_padding(&mut self, first: usize) {
        let (words, used) = (self.words(), self.bits % 64);
        if used > 0 {
            for row in self.data[first * words..].chunks_exact_mut(words) {
                row[words - 1] &= (1 << used) - 1;
            }
        }
    }

    /// Bits in a row.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// 64-bit words in a row.
    pub fn words(&self) -> usize {
        self.bits.div_ceil(64)
    }

    /// Bytes in a row of [`BinaryRows::to_bytes`].
    pub fn bytes(&self) -> usize {
        self.bits.div_ceil(8)
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.data.len() / self.words()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    /// Row `index`.
    pub fn row(&self, index: usize) -> &[u64] {
        &self.data[index * self.words()..][..self.words()]
    }

    /// All words, row after row.
    pub fn data(&self) -> &[u64] {
        &self.data
    }

    /// Appends a row. What is set beyond its bits is cleared.
    ///
    /// # Panics
    /// If `row` does not have [`BinaryRows::words`] words.
    pub fn push(&mut self, row: &[u64]) {
        assert_eq!(row.len(), self.words(), "a row has {} words", self.words());
        let index = self.len();
        self.data.extend_from_slice(row);
        self.clear_padding(index);
    }

    /// Appends a row that is given as in [`BinaryRows::from_bytes`].
    ///
    /// # Panics
    /// If `row` does not have [`BinaryRows::bytes`] bytes.
    pub fn push_bytes(&mut self, row: &[u8]) {
        assert_eq!(row.len(), self.bytes(), "a row has {} bytes", self.bytes());
        let index = self.len();
        self.data.extend(row.chunks(8).map(|bytes| {
            let mut word = [0; 8];
            word[..bytes.len()].copy_from_slice(bytes);
            u64::from_le_bytes(word)
        }));
        self.clear_padding(index);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::two_nearest_floats;

    #[test]
    fn binary_rows_are_padded_to_words() {
        let mut rows = BinaryRows::new(486);
        assert_eq!(rows.words(), 8);
        rows.push(&[7; 8]);
        assert_eq!((rows.len(), rows.row(0)), (1, &[7; 8][..]));
    }

    #[test]
    fn what_is_set_beyond_the_bits_counts_nowhere() {
        let mut rows = BinaryRows::from_vec(70, vec![u64::MAX; 4]);
        rows.push(&[u64::MAX; 2]);
        for index in 0..3 {
            assert_eq!(rows.row(index), [u64::MAX, 0b11_1111]);
        }
    }

    #[test]
    fn bytes_are_words_from_the_least_significant_on() {
        // 9 bytes in a row, the last with 6 bits.
        let bytes: Vec<u8> = (0..8)
            .chain([0x3f])
            .chain(0x60..0x68)
            .chain([0xc5])
            .collect();
        let rows = BinaryRows::from_bytes(70, &bytes);
        assert_eq!((rows.bytes(), rows.len()), (9, 2));
        assert_eq!(rows.row(0), [0x0706_0504_0302_0100, 0x3f]);
        assert_eq!(rows.row(1), [0x6766_6564_6362_6160, 0x05]);
        assert_eq!(rows.to_bytes()[..17], bytes[..17]);
        assert_eq!(rows.to_bytes()[17], 0x05);
        assert_eq!(BinaryRows::from_bytes(70, &rows.to_bytes()), rows);
        let first = |row: u64| BinaryRows::from_vec(12, vec![row]);
        assert_eq!(BinaryRows::from_bytes(12, &[0xff, 0xff]), first(0xfff));
        assert!(BinaryRows::from_bytes(12, &[]).is_empty());
    }

    #[test]
    #[should_panic(expected = "3 bytes in rows of 12 bits")]
    fn ragged_bytes_are_refused() {
        BinaryRows::from_bytes(12, &[0; 3]);
    }

    #[test]
    fn rows_that_come_after_a_search_are_found_by_the_next() {
        let dim = 128;
        let mut rng = Seed(1).rng();
        let values = (0..500 * dim).map(|_| rng.below(200) as f32).collect();
        let mut rows = FloatRows::from_vec(dim, values);
        let query = FloatRows::from_vec(dim, vec![255.0; dim]);
        let find = |rows: &FloatRows| {
            two_nearest_floats(query.data(), rows.data(), dim, rows.prepared(), None)[0].index
        };
        assert!(find(&rows) < 500);
        rows.push(&vec![254.0; dim]);
        assert_eq!(find(&rows), 500);
    }

    #[test]
    fn distances_of_the_largest_values_are_finite() {
        for dim in [1, 3, 128, 4096, 1 << 20] {
            let largest = FloatRows::largest_value(dim);
            let distance = |value: f32| {
                let [a, b] =
                    [value, -value].map(|value| FloatRows::from_vec(dim, vec![value; dim]));
                two_nearest_floats(a.data(), b.data(), dim, b.prepared(), None)[0].nearest
            };
            assert!(distance(largest).is_finite(), "{dim}");
            assert!(distance(2.0 * largest).is_infinite(), "{dim}");
        }
    }

    #[test]
    #[should_panic(expected = "3 values in rows of 2")]
    fn ragged_rows_are_refused() {
        FloatRows::from_vec(2, vec![0.0; 3]);
    }
}
