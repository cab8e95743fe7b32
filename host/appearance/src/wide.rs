//! Loops over lanes with the widest vectors of this processor.
//!
//! Problem: the program is built for any processor of its kind, which leaves half of the lanes of most of them idle.
//! Method: the same code is compiled a second time for AVX2. Every operation is still rounded once and in the same order, as
//! multiplications and additions are not fused: equal bit for bit. Only what is inlined gains: the
//! closure itself has to be `#[inline(always)]`, since it is called in two places, and so has what it calls.

/// Does some work, with AVX2 where there is.
#[inline(always)]
pub fn wide<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn compiled<R>(work: impl FnOnce() -> R) -> R {
            work()
        }
        if is_x86_feature_detected!("avx2") {
            #[expect(unsafe_code, reason = "a call to code compiled for a processor feature")]
            // SAFETY: the only requirement of `compiled` is that the processor has AVX2, just detected.
            return unsafe { compiled(work) };
        }
    }
    work()
}
