//! Host parameter structs and their member offsets, for the proof that they equal the shaders' `Params`.

/// The layout of one host struct: its size and each member's name and byte offset, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Bytes, padding included.
    pub size: usize,
    /// Names and byte offsets.
    pub members: &'static [(&'static str, usize)],
}

/// A `Params` struct whose layout can be compared with what naga reflects.
pub trait HostParams: bytemuck::Pod {
    /// As the compiler laid it out.
    const LAYOUT: Layout;
}

/// Implements [`HostParams`] for a struct; every member must be listed, or the struct does not destructure.
macro_rules! layout {
    ($name:ident { $($member:ident),* $(,)? }) => {
        impl $crate::layout::HostParams for $name {
            const LAYOUT: $crate::layout::Layout = {
                // Fails to compile when a member is missing from the list.
                let _all = |all: &$name| { let $name { $($member: _),* } = all; };
                $crate::layout::Layout {
                    size: size_of::<$name>(),
                    members: &[$((stringify!($member), std::mem::offset_of!($name, $member))),*],
                }
            };
        }
    };
}
pub(crate) use layout;
