//! What was learned for DLCO, and how it is written.

use super::Ring;
use crate::params::ParamError;

/// First bytes of a table.
const MAGIC: &[u8; 4] = b"DLC1";

/// Least standard deviation of a region, in pixels: those of much smaller ones have no pixel with a weight.
const MIN_SIGMA: f32 = 0.1;

/// Rings of pooling regions and a projection of what is pooled in them.
#[derive(Clone, Debug, PartialEq)]
pub struct DlcoTable {
    /// The selected rings.
    pub rings: Vec<Ring>,
    /// Rows of the projection, most important first; as many columns as values are pooled.
    pub projection: Vec<Vec<f32>>,
}

impl DlcoTable {
    /// Number of pooled values: eight for each region.
    pub fn pooled(&self) -> usize {
        pooled(&self.rings)
    }

    /// The table as bytes: magic, two counts, rings, rows; little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        for count in [self.rings.len(), self.projection.len()] {
            bytes.extend((count as u16).to_le_bytes());
        }
        let rings = (self.rings.iter()).flat_map(|ring| [ring.radius, ring.turn, ring.sigma]);
        for value in rings.chain(self.projection.iter().flatten().copied()) {
            bytes.extend(value.to_le_bytes());
        }
        bytes
    }

    /// The table that was written as `bytes`.
    ///
    /// # Errors
    /// If they are not such a table.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ParamError> {
        let table = Self::parse(bytes).ok_or_else(Self::refusal)?;
        table.check()?;
        Ok(table)
    }

    /// Whether patches can be described with it, and its counts can be written.
    ///
    /// # Errors
    /// If not.
    pub(super) fn check(&self) -> Result<(), ParamError> {
        let columns = self.pooled();
        let fits = |count: usize| (1..=usize::from(u16::MAX)).contains(&count);
        let sound = |ring: &Ring| {
            let is_finite = ring.turn.is_finite() && ring.sigma.is_finite();
            is_finite && ring.sigma >= MIN_SIGMA && (0.0..=64.0).contains(&ring.radius)
        };
        let whole =
            |row: &Vec<f32>| row.len() == columns && row.iter().all(|value| value.is_finite());
        (fits(self.rings.len())
            && fits(self.projection.len())
            && self.rings.iter().all(sound)
            && self.projection.iter().all(whole))
        .then_some(())
        .ok_or_else(Self::refusal)
    }

    fn refusal() -> ParamError {
        ParamError("not a DLCO table".into())
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.strip_prefix(MAGIC)?;
        let (counts, bytes) = bytes.split_at_checked(4)?;
        let count = |i: usize| usize::from(u16::from_le_bytes([counts[2 * i], counts[2 * i + 1]]));
        let (values, rest) = bytes.as_chunks::<4>();
        let values: Vec<f32> = values
            .iter()
            .map(|&value| f32::from_le_bytes(value))
            .collect();
        let (rings, projection) = values.split_at_checked(3 * count(0))?;
        let rings: Vec<Ring> = (rings.as_chunks::<3>().0.iter())
            .map(|&[radius, turn, sigma]| Ring {
                radius,
                turn,
                sigma,
            })
            .collect();
        let columns = pooled(&rings);
        (rest.is_empty() && columns > 0 && projection.len() == count(1) * columns).then(|| Self {
            rings,
            projection: projection
                .chunks_exact(columns)
                .map(<[f32]>::to_vec)
                .collect(),
        })
    }
}

fn pooled(rings: &[Ring]) -> usize {
    8 * rings.iter().map(|ring| ring.centres().len()).sum::<usize>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_ones_own_are_looked_at() {
        let ring = Ring {
            radius: 5.0,
            turn: 0.125,
            sigma: 3.0,
        };
        let table = |rings: &[Ring], row: Vec<f32>| DlcoTable {
            rings: rings.to_vec(),
            projection: vec![row],
        };
        assert!(table(&[ring], vec![0.5; 32]).check().is_ok());
        assert!(table(&[], vec![]).check().is_err());
        // A region about the corner of four pixels, with no weight for any of them.
        let nothing = Ring {
            sigma: 1e-2,
            ..ring
        };
        assert!(table(&[nothing], vec![0.5; 32]).check().is_err());
        assert!(table(&[ring], vec![0.5; 31]).check().is_err());
        assert!(table(&[ring], vec![f32::NAN; 32]).check().is_err());
        assert!(
            table(&[Ring { sigma: 0.0, ..ring }], vec![0.5; 32])
                .check()
                .is_err()
        );
    }

    #[test]
    fn a_table_survives_being_written_and_damage_is_seen() {
        let table = DlcoTable {
            rings: vec![Ring {
                radius: 5.0,
                turn: 0.125,
                sigma: 3.0,
            }],
            projection: vec![vec![0.5; 32], vec![-1.0; 32]],
        };
        let bytes = table.to_bytes();
        assert_eq!(DlcoTable::from_bytes(&bytes), Ok(table));
        for end in 0..bytes.len() {
            assert!(DlcoTable::from_bytes(&bytes[..end]).is_err(), "{end} bytes");
        }
        for (at, value) in [(0, 0), (4, 2), (6, 3), (11, 0xff), (19, 0xc0), (23, 0x7f)] {
            let mut damaged = bytes.clone();
            damaged[at] = value;
            if at == 23 {
                damaged[22] = 0xff; // infinite or no number
            }
            assert!(DlcoTable::from_bytes(&damaged).is_err(), "byte {at}");
        }
    }
}
