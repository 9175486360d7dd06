//! Which instructions the kernels use: the widest that the processor has, or those asked for.
//!
//! The environment variable `MATCHBENCH_SIMD` (`portable`, `avx2`, `avx512` or `amx`) asks for one set, so
//! that versions can be compared on one machine. The choice is kept for the life of the process. It changes no
//! result: every version gives the same bits.
//!
//! "AVX-512" means what Intel's Ice Lake (2019) and AMD's Zen 4 (2022) brought: the base of x86-64-v4,
//! products of bytes (VNNI), counts of bits (VPOPCNTDQ) and permutations of bytes (VBMI). Processors that
//! have less of it clock down so far for vectors of 64 bytes that those of 32 are as fast, so they use
//! AVX2. "AMX" is, beside that, what Intel's Sapphire Rapids (2023) brought: products of tiles of bytes.
//! Zen 4 executes vectors of 64 bytes in halves. Most kernels gain by them nevertheless; those that do not ask for
//! [`InstructionSet::in_use_unless_halved`].

use std::sync::atomic::{AtomicU8, Ordering};

use crate::params::ParamError;
use crate::simd::processor::halves_vectors;
#[cfg(target_arch = "x86_64")]
use crate::simd::tiles;

/// Instructions that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// What every processor of the platform has.
    Portable = 1,
    /// Vectors of 32 bytes and fused multiply-add.
    Avx2,
    /// Vectors of 64 bytes, products and permutations of bytes, counts of bits.
    Avx512,
    /// Those, and products of tiles of bytes in the searches.
    Amx,
}

use InstructionSet::{Amx, Avx2, Avx512, Portable};

/// The choice, or 0 before it is made. A race makes the same choice twice.
static IN_USE: AtomicU8 = AtomicU8::new(0);

/// The bit of the choice that says that vectors of 64 bytes are halved, and that nobody asked for them.
const HALVED: u8 = 1 << 7;

impl InstructionSet {
    /// All of them, from the narrowest to the widest.
    pub const ALL: [Self; 4] = [Portable, Avx2, Avx512, Amx];

    /// Its name in `MATCHBENCH_SIMD`.
    pub fn name(self) -> &'static str {
        match self {
            Portable => "portable",
            Avx2 => "avx2",
            Avx512 => "avx512",
            Amx => "amx",
        }
    }

    /// The widest that this processor has. It asks the system for tiles, which a process cannot give back.
    pub fn widest() -> Self {
        match Self::widest_vectors() {
            #[cfg(target_arch = "x86_64")]
            Avx512 if tiles::are_there() => Amx,
            other => other,
        }
    }

    /// The widest that has no tiles.
    fn widest_vectors() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            macro_rules! has {
                ($($feature:tt)*) => { $(std::arch::is_x86_feature_detected!($feature))&&* };
            }
            if has!("avx2" "fma") {
                let wider = has!("avx512f" "avx512bw" "avx512cd" "avx512dq" "avx512vl")
                    && has!("avx512vnni" "avx512vpopcntdq" "avx512vbmi");
                return if wider { Avx512 } else { Avx2 };
            }
        }
        Portable
    }

    /// What `MATCHBENCH_SIMD` asks for, or the widest.
    ///
    /// # Errors
    /// If it asks for something unknown or something that this processor lacks.
    pub fn asked_for() -> Result<Self, ParamError> {
        let Some(name) = std::env::var_os("MATCHBENCH_SIMD") else {
            return Ok(Self::widest());
        };
        let name = name.to_string_lossy();
        match Self::ALL.iter().find(|set| set.name() == name) {
            // Tiles are not asked for where they are not wanted.
            Some(&set) if set <= Self::widest_vectors() => Ok(set),
            Some(&set) if set == Self::widest() => Ok(set),
            Some(_) => Err(ParamError(format!(
                "MATCHBENCH_SIMD asks for `{name}`; this processor has no more than `{}`",
                Self::widest().name()
            ))),
            None => Err(ParamError(format!(
                "MATCHBENCH_SIMD is `{name}`, but must be portable, avx2, avx512 or amx"
            ))),
        }
    }

    /// What kernels use in this process: the choice is made once.
    ///
    /// # Panics
    /// If [`Self::asked_for`] is an error, which programs should report when they start.
    #[inline]
    pub fn in_use() -> Self {
        Self::of_choice(Self::choice())
    }

    /// [`Self::in_use`], but AVX2 instead of AVX-512 where the processor executes vectors of 64 bytes in halves, unless
    /// `MATCHBENCH_SIMD` asks for AVX-512. For kernels whose version for 64 bytes makes more operations in all.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    pub(super) fn in_use_unless_halved() -> Self {
        let choice = Self::choice();
        if choice & HALVED == 0 {
            Self::of_choice(choice)
        } else {
            Avx2
        }
    }

    #[inline]
    fn of_choice(choice: u8) -> Self {
        match choice & !HALVED {
            4 => Amx,
            3 => Avx512,
            2 => Avx2,
            _ => Portable,
        }
    }

    /// The set as a number, with [`HALVED`] where that applies.
    #[inline]
    fn choice() -> u8 {
        #[cfg(test)]
        if let Some(set) = tests::FORCED.get() {
            return set as u8;
        }
        match IN_USE.load(Ordering::Relaxed) {
            0 => Self::choose(),
            choice => choice,
        }
    }

    #[cold]
    fn choose() -> u8 {
        let set = Self::asked_for().unwrap_or_else(|error| panic!("{error}"));
        let is_asked_for = std::env::var_os("MATCHBENCH_SIMD").is_some();
        let halved = set == Avx512 && !is_asked_for && halves_vectors();
        let choice = set as u8 | if halved { HALVED } else { 0 };
        IN_USE.store(choice, Ordering::Relaxed);
        choice
    }

    /// Calls `each` with every set that this processor has, while kernels called from this thread use
    /// that one.
    #[cfg(test)]
    pub(crate) fn for_each(mut each: impl FnMut(Self)) {
        for set in Self::ALL.into_iter().filter(|&set| set <= Self::widest()) {
            let before = tests::FORCED.replace(Some(set));
            each(set);
            tests::FORCED.set(before);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    thread_local! {
        pub(super) static FORCED: Cell<Option<InstructionSet>> = const { Cell::new(None) };
    }

    #[test]
    fn every_set_up_to_the_widest_can_be_forced() {
        let mut forced = Vec::new();
        InstructionSet::for_each(|set| {
            assert_eq!(InstructionSet::in_use(), set);
            forced.push(set);
        });
        assert_eq!(forced.last(), Some(&InstructionSet::widest()));
        assert!(forced.is_sorted() && forced[0] == Portable);
        assert_eq!(
            InstructionSet::in_use(),
            InstructionSet::asked_for().expect("tests ask for what there is")
        );
    }

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn vectors_are_halved_only_where_they_are_wide_and_nobody_asked_for_them() {
        let (set, unless_halved) = (
            InstructionSet::in_use(),
            InstructionSet::in_use_unless_halved(),
        );
        let is_asked_for = std::env::var_os("MATCHBENCH_SIMD").is_some();
        if set == Avx512 && halves_vectors() && !is_asked_for {
            assert_eq!(unless_halved, Avx2);
        } else {
            assert_eq!(unless_halved, set);
        }
        InstructionSet::for_each(|set| assert_eq!(InstructionSet::in_use_unless_halved(), set));
    }
}
