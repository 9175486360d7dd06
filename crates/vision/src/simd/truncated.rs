//! Conversion of floating-point numbers to whole ones by truncation, vectorised.

/// `value` without its fraction. What an `i32` cannot hold becomes its least number or about its largest,
/// what is no number the least.
///
/// *Benefit*: two limits and one instruction for a whole vector; `as` is compiled number by number, since
/// it gives 0 for what is none.
#[inline(always)]
pub(super) fn truncated(value: f32) -> i32 {
    /// The largest value below 2^31.
    const LAST: f32 = 2_147_483_520.0;
    const FIRST: f32 = i32::MIN as f32;
    let value = if value > FIRST { value } else { FIRST };
    let value = if value < LAST { value } else { LAST };
    // SAFETY: a number from -2^31 to below 2^31 has a whole part that an `i32` holds.
    unsafe { value.to_int_unchecked() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_parts_are_those_of_the_language() {
        for value in [
            -2_147_483_648.0,
            -8e8,
            -2.75,
            -0.5,
            -0.0,
            0.0,
            0.999,
            3.0,
            8_388_609.0,
            2e9,
        ] {
            assert_eq!(truncated(value), value as i32, "{value}");
        }
        assert_eq!(truncated(f32::INFINITY), 2_147_483_520);
        assert_eq!(truncated(f32::NEG_INFINITY), i32::MIN);
        assert_eq!(truncated(f32::NAN), i32::MIN);
    }
}
