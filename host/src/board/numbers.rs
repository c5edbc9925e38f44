//! The number type of a board's kernel, which is known once the board has answered.

use motion_kernel::link::Identity;

/// A number type that kernels compute in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numbers {
    /// `f32`.
    F32,
    /// [`Fixed`](motion_kernel::num::Fixed).
    Fixed,
}

impl Numbers {
    /// That of a board that calls itself this.
    #[must_use]
    pub const fn of(identity: &Identity) -> Self {
        if identity.is_fixed_point { Self::Fixed } else { Self::F32 }
    }
}

/// A result with a type named `$R`: only what needs it is compiled for each number type.
macro_rules! in_numbers {
    ($numbers:expr, $R:ident => $result:expr) => {
        match $numbers {
            $crate::board::Numbers::F32 => {
                type $R = f32;
                $result
            }
            $crate::board::Numbers::Fixed => {
                type $R = ::motion_kernel::num::Fixed;
                $result
            }
        }
    };
}
pub(crate) use in_numbers;
