//! `field`: `field.safetensors`, what paths of points are evaluated from, whole. The library writes it from its field; this is
//! what it leaves and takes.

use super::format::{Each, FileKind, Format, Points};

pub(super) const FORMAT: Format = Format {
    name: "field",
    needs_cameras: true,
    needs_motion: true,
    files: &[
        FileKind::one(
            "field.safetensors",
            "what paths of points are evaluated from (omnix query); layout in its documentation and header",
        )
        .with(Points::Network),
        FileKind {
            name: "field/NNNNNN.safetensors",
            each: Each::Window,
            contains: "the field of a window of the film, which field.safetensors joins to the others",
            points: Points::Network,
        },
    ],
    disk: |size| size.field_bytes,
    ..Format::NONE
};
