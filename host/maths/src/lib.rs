//! Mathematics with the same last bit on every machine.
//!
//! Problem: a standard sine, logarithm or power is the system's, and systems differ in the last bit of one
//! result in ten. A dot is a decision between two sums; where one falls the other way, all dots after it do.
//! Of a printed leaf, a quarter of the dots lay elsewhere.
//! Method: the functions of the crate `libm`, which is written in Rust and compiled with us, under names of
//! their own, so that a lint can forbid the standard ones (`clippy.toml`). Whole powers are products in a
//! fixed order; the standard
//! `powi` promises no order. A square root is right to the last bit everywhere by IEEE 754 and stays the
//! standard one. Cost: that of the system's, up to twice for powers. Limits: errors are below one unit in the
//! last place, a whole power's below that of its products.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests compare with the standard mathematics"))]

/// Functions whose results are equal on every machine.
pub trait Maths: Copy {
    /// The sine of an angle.
    fn sine(self) -> Self;
    /// The cosine of an angle.
    fn cosine(self) -> Self;
    /// Sine and cosine of an angle.
    fn sine_cosine(self) -> (Self, Self);
    /// The tangent of an angle.
    fn tangent(self) -> Self;
    /// The angle with this sine, of -π/2 to π/2.
    fn arcsine(self) -> Self;
    /// The angle with this cosine, of 0 to π.
    fn arccosine(self) -> Self;
    /// The angle with this tangent, of -π/2 to π/2.
    fn arctangent(self) -> Self;
    /// The angle of the point (`x`, `self`), of -π to π.
    fn arctangent2(self, x: Self) -> Self;
    /// e to this power.
    fn exponential(self) -> Self;
    /// 2 to this power.
    fn exponential2(self) -> Self;
    /// The natural logarithm.
    fn logarithm(self) -> Self;
    /// The logarithm to base 2.
    fn logarithm2(self) -> Self;
    /// The logarithm to base 10.
    fn logarithm10(self) -> Self;
    /// This to a power.
    fn power(self, exponent: Self) -> Self;
    /// This to a whole power: products by repeated squaring, and the reciprocal for a negative one.
    fn whole_power(self, exponent: i32) -> Self;
    /// This times itself.
    fn squared(self) -> Self;
    /// This times itself, twice.
    fn cubed(self) -> Self;
    /// The number whose cube this is.
    fn cube_root(self) -> Self;
    /// The long side of a right-angled triangle with these two short ones.
    fn hypotenuse(self, other: Self) -> Self;
}

macro_rules! maths {
    ($number:ty, $power:path: $($name:ident($($more:ident)?) = $function:ident,)*) => {
        impl Maths for $number {
            $(#[inline]
            fn $name(self $(, $more: Self)?) -> Self {
                libm::$function(self $(, $more)?)
            })*

            #[inline]
            fn power(self, exponent: Self) -> Self {
                $power(self, exponent)
            }

            #[inline]
            fn sine_cosine(self) -> (Self, Self) {
                (self.sine(), self.cosine())
            }

            #[inline]
            fn whole_power(self, exponent: i32) -> Self {
                let (mut product, mut square, mut left) = (1.0, self, exponent.unsigned_abs());
                loop {
                    if left & 1 == 1 {
                        product *= square;
                    }
                    left >>= 1;
                    if left == 0 {
                        break;
                    }
                    square *= square;
                }
                if exponent < 0 { 1.0 / product } else { product }
            }

            #[inline]
            fn squared(self) -> Self {
                self * self
            }

            #[inline]
            fn cubed(self) -> Self {
                self * self * self
            }
        }
    };
}

/// A power in 32 bits by a logarithm in 64, whose error is lost in the rounding: a quarter of `libm`'s time.
fn single_power(base: f32, exponent: f32) -> f32 {
    if !(base > 0.0 && base.is_finite() && exponent.is_finite()) {
        return libm::powf(base, exponent);
    }
    (f64::from(exponent) * f64::from(base).logarithm()).exponential() as f32
}

maths! { f64, libm::pow:
    sine() = sin,
    cosine() = cos,
    tangent() = tan,
    arcsine() = asin,
    arccosine() = acos,
    arctangent() = atan,
    arctangent2(x) = atan2,
    exponential() = exp,
    exponential2() = exp2,
    logarithm() = log,
    logarithm2() = log2,
    logarithm10() = log10,
    cube_root() = cbrt,
    hypotenuse(other) = hypot,
}

maths! { f32, single_power:
    sine() = sinf,
    cosine() = cosf,
    tangent() = tanf,
    arcsine() = asinf,
    arccosine() = acosf,
    arctangent() = atanf,
    arctangent2(x) = atan2f,
    exponential() = expf,
    exponential2() = exp2f,
    logarithm() = logf,
    logarithm2() = log2f,
    logarithm10() = log10f,
    cube_root() = cbrtf,
    hypotenuse(other) = hypotf,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arguments all over the range in which a function is asked, from little to much.
    fn arguments(from: f64, to: f64) -> impl Iterator<Item = f64> {
        (0..50_000u32).map(move |i| {
            let part = f64::from(i.wrapping_mul(0x9e37_79b1)) / f64::from(u32::MAX);
            from + (to - from) * part * part
        })
    }

    /// Each function with its range, and the standard one.
    type Row = (&'static str, fn(f64) -> f64, fn(f64) -> f64, [f64; 2]);

    const ROWS: [Row; 13] = [
        ("sine", f64::sine, f64::sin, [-20.0, 20.0]),
        ("cosine", f64::cosine, f64::cos, [-20.0, 20.0]),
        ("tangent", f64::tangent, f64::tan, [-1.57, 1.57]),
        ("arcsine", f64::arcsine, f64::asin, [-1.0, 1.0]),
        ("arccosine", f64::arccosine, f64::acos, [-1.0, 1.0]),
        ("arctangent", f64::arctangent, f64::atan, [-50.0, 50.0]),
        ("exponential", f64::exponential, f64::exp, [-700.0, 700.0]),
        ("exponential2", f64::exponential2, f64::exp2, [-100.0, 100.0]),
        ("logarithm", f64::logarithm, f64::ln, [1e-30, 1e6]),
        ("logarithm2", f64::logarithm2, f64::log2, [1e-30, 1e6]),
        ("logarithm10", f64::logarithm10, f64::log10, [1e-30, 1e6]),
        ("power", |x| x.power(1.0 / 2.4), |x| x.powf(1.0 / 2.4), [0.0, 1e3]),
        ("cube root", f64::cube_root, f64::cbrt, [-1e3, 1e3]),
    ];

    /// Units in the last place between two numbers.
    fn units(a: f64, b: f64) -> u64 {
        a.to_bits().abs_diff(b.to_bits())
    }

    #[test]
    fn functions_are_the_standard_ones_to_a_unit_or_two_in_the_last_place() {
        for (name, ours, standard, [from, to]) in ROWS {
            for x in arguments(from, to) {
                assert!(units(ours(x), standard(x)) <= 2, "{name} of {x}: {} {}", ours(x), standard(x));
                let (single, double) = (x as f32, standard(f64::from(x as f32)) as f32);
                let found = match name {
                    "sine" => single.sine(),
                    "arcsine" => single.arcsine(),
                    "logarithm" => single.logarithm(),
                    "power" => single.power(1.0 / 2.4),
                    "cube root" => single.cube_root(),
                    _ => continue,
                };
                let near = (found - double).abs() <= 2.0 * f32::EPSILON * double.abs().max(f32::MIN_POSITIVE);
                assert!(
                    near || name == "sine" && (found - double).abs() < 1e-7,
                    "{name} {single}: {found} {double}"
                );
            }
        }
        for (y, x) in arguments(-9.0, 9.0).zip(arguments(7.0, -7.0)) {
            assert!(units(y.arctangent2(x), y.atan2(x)) <= 2, "{y} {x}");
            assert!(units(y.hypotenuse(x), y.hypot(x)) <= 1, "{y} {x}");
            assert_eq!(y.sine_cosine(), (y.sine(), y.cosine()));
        }
    }

    /// Where a power is no logarithm's multiple.
    #[test]
    fn powers_of_nothing_and_of_negative_numbers_are_the_standard_ones() {
        let odd = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            2.0,
            -8.0,
            0.3,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            f32::MAX,
            1e-45,
        ];
        for (base, exponent) in odd.into_iter().flat_map(|x| odd.map(|y| (x, y))) {
            let (found, expected) = (base.power(exponent), base.powf(exponent));
            assert!(found.to_bits().abs_diff(expected.to_bits()) <= 1 || found.is_nan() && expected.is_nan());
        }
    }

    /// Whole numbers have whole powers, which integers tell.
    #[test]
    fn whole_powers_are_products() {
        for base in -9i32..=9 {
            let x = f64::from(base);
            for exponent in 0..16 {
                let expected = i64::from(base).pow(exponent) as f64;
                assert_eq!(x.whole_power(exponent as i32), expected, "{base} to {exponent}");
                if base != 0 {
                    assert_eq!(x.whole_power(-(exponent as i32)), 1.0 / expected);
                }
            }
            assert_eq!((x.squared(), x.cubed()), (x.whole_power(2), x.whole_power(3)));
        }
        assert_eq!(2f64.whole_power(i32::MIN), 0.0);
        assert_eq!(1f32.whole_power(i32::MIN), 1.0);
    }

    /// Of the rows above.
    const LAST_BITS: [u64; 13] = [
        0x1a400e43aa4c3c61,
        0xf713ec17e7baa168,
        0x56822f6fadde035b,
        0x103375ea587cf5dc,
        0x4e944a44c7069f62,
        0x3312ac6e1b4b408f,
        0x3217a625321e45d9,
        0x1bb326d24d30b7af,
        0x925a63319b3b2109,
        0x59a5f6d9f0f6129d,
        0xf263fcf6c159b030,
        0x776d1f0643211c26,
        0x0b633e8c5a5148a0,
    ];

    /// What every machine has to find, to the last bit; FNV-1a of all results. A version of `libm` that
    /// rounds otherwise changes jobs, and says so here.
    #[test]
    fn the_last_bits_are_these_everywhere() {
        let digest = |results: &mut dyn Iterator<Item = f64>| {
            results.fold(0xcbf2_9ce4_8422_2325u64, |sum, x| {
                x.to_bits()
                    .to_le_bytes()
                    .iter()
                    .fold(sum, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
            })
        };
        let found = ROWS.map(|(_, ours, _, [from, to])| digest(&mut arguments(from, to).map(ours)));
        assert_eq!(found, LAST_BITS);
    }
}
