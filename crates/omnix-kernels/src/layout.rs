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

/// Makes the `Params` struct of a shader, of plain 32-bit numbers and arrays of them, with its [`HostParams`].
macro_rules! params {
    ($(#[$doc:meta])* pub struct $name:ident {
        $($(#[$field_doc:meta])* $access:vis $member:ident: $kind:ty),* $(,)?
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        pub struct $name {
            $($(#[$field_doc])* $access $member: $kind,)*
        }

        impl $crate::layout::HostParams for $name {
            const LAYOUT: $crate::layout::Layout = $crate::layout::Layout {
                size: size_of::<$name>(),
                members: &[$((stringify!($member), std::mem::offset_of!($name, $member))),*],
            };
        }
    };
}
pub(crate) use params;
