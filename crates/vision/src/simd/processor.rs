//! What the processor says of itself beside its features, which the standard library knows.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__cpuid_count, CpuidResult};
#[cfg(target_arch = "x86_64")]
use std::sync::LazyLock;

/// What the processor answers to a question (CPUID, with subquestion 0).
#[cfg(target_arch = "x86_64")]
pub(super) fn answer(question: u32) -> CpuidResult {
    #[allow(unused_unsafe)] // which it no longer is in later versions of the language
    // SAFETY: every processor of 64 bits answers.
    unsafe {
        __cpuid_count(question, 0)
    }
}

/// Bytes of the second-level cache of a core, if the processor tells. It is asked once, since a virtual machine takes
/// microseconds for an answer.
pub fn second_level_cache() -> Option<usize> {
    #[cfg(target_arch = "x86_64")]
    {
        static BYTES: LazyLock<Option<usize>> = LazyLock::new(|| {
            const QUESTION: u32 = 0x8000_0006;
            let is_known = answer(0x8000_0000).eax >= QUESTION;
            let bytes = is_known.then(|| (answer(QUESTION).ecx >> 16) as usize * 1024);
            bytes.filter(|&bytes| bytes > 0)
        });
        *BYTES
    }
    #[cfg(not(target_arch = "x86_64"))]
    None
}

/// Whether this processor, which has AVX-512, executes vectors of 64 bytes in halves: AMD's family 25 (Zen 4).
pub(super) fn halves_vectors() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        let CpuidResult { ebx, ecx, edx, .. } = answer(0);
        let maker = [ebx, edx, ecx].map(u32::to_le_bytes);
        let version = answer(1).eax;
        // A family of 15 is continued by the extended family.
        let family = (version >> 8 & 0xf) + (version >> 20 & 0xff);
        maker.as_flattened() == b"AuthenticAMD" && family == 25
    }
    #[cfg(not(target_arch = "x86_64"))]
    false
}
