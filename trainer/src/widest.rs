//! Plain loops in the widest vectors that this CPU has.
//!
//! The program is compiled for any CPU of its kind. What is inlined into [`widest`] is compiled once more for
//! each kind of vector, so the compiler's own vectorization uses them. The bits do not change: no
//! operation is fused or reordered.

use dermis_runtime::Kernel;
use dermis_runtime::kernel::Work;
use dermis_runtime::lanes::Lanes;

/// Calls `work`, which should be marked `#[inline(always)]`, as should all that it calls.
#[inline(always)]
pub(crate) fn widest<R>(work: impl FnOnce() -> R) -> R {
    Kernel::detect().run(Plain(work))
}

struct Plain<F>(F);

impl<R, F: FnOnce() -> R> Work for Plain<F> {
    type Output = R;

    #[inline(always)]
    fn run<V: Lanes>(self, _: V::Token) -> R {
        (self.0)()
    }
}
