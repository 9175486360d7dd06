//! Products of matrices of bytes by the processor's tiles (Intel's AMX, from Sapphire Rapids, 2023, on).
//!
//! *How it works.* A tile is a register of 16 rows of 64 bytes. One instruction multiplies 16 rows of bytes with 16
//! columns of bytes, 64 long, and adds the 256 sums to a tile of 32-bit integers: eight times as many products a
//! cycle as vectors of 64 bytes make. Two tiles of rows and two of columns make four tiles of sums, so that a tile
//! that was loaded is used twice. A thread says how large its tiles are before it uses them and hands them
//! back afterwards; the system gives them only to processes that asked for them.
//!
//! *Benefit*: searches that multiply bytes. *Correctness*: the products are whole numbers and their sums are
//! exact; tests compare with the definition.
//!
//! The instructions are written in assembly, since the language does not know them yet. The compiler never uses tiles
//! by itself, so nothing else can be in them.

use std::arch::asm;
use std::marker::PhantomData;

use super::processor::answer;

/// Rows of one side that are multiplied with as many of the other.
pub(super) const ROWS: usize = 32;

/// Columns that one vector holds of the products.
pub(super) const LANES: usize = 16;

/// 64 bytes of 32 rows: two tiles. On the left side each row is one row of the matrix. On the right, row `r` of either
/// tile has bytes `4 r` to `4 r + 3` of its 16 columns, one column after the other.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Bytes(pub(super) [[u8; 64]; ROWS]);

impl Bytes {
    pub(super) const ZERO: Self = Self([[0; 64]; ROWS]);
}

/// `[half of the columns][row][column of the half]`: sums of products.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Products(pub(super) [[[i32; LANES]; ROWS]; 2]);

impl Products {
    pub(super) const ZERO: Self = Self([[[0; LANES]; ROWS]; 2]);
}

/// Whether the processor has tiles of bytes and the system lets this process use them.
pub(super) fn are_there() -> bool {
    /// Structured extended features.
    const FEATURES: u32 = 7;
    /// AMX-TILE and AMX-INT8, in EDX.
    const TILES_OF_BYTES: u32 = 1 << 24 | 1 << 25;
    answer(0).eax >= FEATURES
        && answer(FEATURES).edx & TILES_OF_BYTES == TILES_OF_BYTES
        && are_permitted()
}

/// Asks the system for tiles, for this process and all its threads; it may be asked again.
#[cfg(target_os = "linux")]
fn are_permitted() -> bool {
    /// `arch_prctl`.
    const CALL: i64 = 158;
    /// `ARCH_REQ_XCOMP_PERM`.
    const REQUEST: u64 = 0x1023;
    /// The state of tiles.
    const TILES: u64 = 18;
    let mut result = CALL;
    // SAFETY: the call reads and writes no memory of this process; the two registers are those that calls change.
    unsafe {
        asm!(
            "syscall",
            inout("rax") result,
            in("rdi") REQUEST,
            in("rsi") TILES,
            lateout("rcx") _,
            lateout("r11") _,
            options(nostack),
        );
    }
    result == 0
}

#[cfg(not(target_os = "linux"))]
fn are_permitted() -> bool {
    false
}

/// Which tiles there are: `palette` 1, and bytes of a row and rows of each.
#[repr(C, align(64))]
struct Shapes {
    palette: u8,
    start_row: u8,
    reserved: [u8; 14],
    row_bytes: [u16; 16],
    rows: [u8; 16],
}

/// The eight tiles of this thread, each of 16 rows of 64 bytes, until this is dropped.
pub(super) struct Tiles(PhantomData<*const ()>);

impl Tiles {
    /// # Safety
    /// [`are_there`] must have said so, and no other `Tiles` may live in this thread.
    pub(super) unsafe fn of_this_thread() -> Self {
        let mut shapes = Shapes {
            palette: 1,
            start_row: 0,
            reserved: [0; 14],
            row_bytes: [0; 16],
            rows: [0; 16],
        };
        shapes.row_bytes[..8].fill(64);
        shapes.rows[..8].fill(16);
        // SAFETY: 64 bytes can be read, and they are a valid configuration.
        unsafe { asm!("ldtilecfg [{}]", in(reg) &raw const shapes, options(nostack, readonly)) };
        Self(PhantomData)
    }

    /// The product of 32 rows of bytes from -128 to 127 (`left`) with 32 columns of bytes from 0 to 255 (`right`), 64 bytes
    /// after the other.
    #[inline]
    #[expect(
        clippy::unused_self,
        reason = "tiles have a shape as long as this lives"
    )]
    pub(super) fn multiply(&mut self, left: &[Bytes], right: &[Bytes], products: &mut Products) {
        assert!(
            !left.is_empty() && left.len() == right.len(),
            "as long as each other"
        );
        // SAFETY: tiles 0 to 7 have 16 rows of 64 bytes since `of_this_thread`. Each step reads two tiles of either
        // side, and there are as many as steps; four tiles are written to the products, which have room for four.
        unsafe {
            asm!(
                "tilezero tmm0",
                "tilezero tmm1",
                "tilezero tmm2",
                "tilezero tmm3",
                "2:",
                "tileloadd tmm4, [{left} + {stride}]",
                "tileloadd tmm6, [{right} + {stride}]",
                "tdpbsud tmm0, tmm4, tmm6",
                "tileloadd tmm7, [{right} + {stride} + 1024]",
                "tdpbsud tmm1, tmm4, tmm7",
                "tileloadd tmm5, [{left} + {stride} + 1024]",
                "tdpbsud tmm2, tmm5, tmm6",
                "tdpbsud tmm3, tmm5, tmm7",
                "add {left}, 2048",
                "add {right}, 2048",
                "dec {steps}",
                "jnz 2b",
                "tilestored [{out} + {stride}], tmm0",
                "tilestored [{out} + {stride} + 1024], tmm2",
                "tilestored [{out} + {stride} + 2048], tmm1",
                "tilestored [{out} + {stride} + 3072], tmm3",
                left = inout(reg) left.as_ptr() => _,
                right = inout(reg) right.as_ptr() => _,
                steps = inout(reg) left.len() => _,
                stride = in(reg) 64_usize,
                out = in(reg) &raw mut *products,
                options(nostack),
            );
        }
    }
}

impl Drop for Tiles {
    fn drop(&mut self) {
        // SAFETY: tiles are this thread's, and nothing is in them that is still needed.
        unsafe { asm!("tilerelease", options(nomem, nostack)) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn products_are_those_of_the_definition() {
        if !are_there() {
            return;
        }
        let mut rng = Seed(4).rng();
        for steps in 1..4 {
            let mut draw = || {
                let mut bytes = Bytes::ZERO;
                bytes
                    .0
                    .as_flattened_mut()
                    .fill_with(|| rng.next_u32() as u8);
                bytes
            };
            let left: Vec<Bytes> = (0..steps).map(|_| draw()).collect();
            let right: Vec<Bytes> = (0..steps).map(|_| draw()).collect();
            let mut found = Products::ZERO;
            // SAFETY: they are there.
            let mut tiles = unsafe { Tiles::of_this_thread() };
            for _ in 0..2 {
                // What was there before does not count.
                tiles.multiply(&left, &right, &mut found);
            }
            for (half, found) in found.0.iter().enumerate() {
                for (row, found) in found.iter().enumerate() {
                    for (column, &found) in found.iter().enumerate() {
                        let products = left.iter().zip(&right).flat_map(|(left, right)| {
                            (0..64).map(move |k| {
                                let right = right.0[16 * half + k / 4][4 * column + k % 4];
                                i32::from(left.0[row][k] as i8) * i32::from(right)
                            })
                        });
                        assert_eq!(found, products.sum::<i32>(), "{half} {row} {column}");
                    }
                }
            }
        }
    }
}
