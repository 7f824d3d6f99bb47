//! Films longer than memory: windows of the film, each reconstructed by itself, joined to one scene.
//!
//! ```text
//! pictures ──► cuts ──► layout ──► run: window after window ──► one file a window
//!                                                                   │
//!              film: image after image, in one world ◄── chain: joins of neighbours
//! ```
//!
//! *Layout* (`layout.rs`). A film is cut into shots where the picture changes at once ([`Cuts`]), and a shot into windows of N images
//! of which neighbours share M, at most half of N, so that an image is in two windows at most. The last window of a shot is moved
//! back so that it is full. A shot shorter than N is one window.
//!
//! *Run* (`run.rs`). One session computes one window after the other: the plan is made for N images and serves them all, so the device's
//! memory is that of N images however long the film is. Times are counted from the window's first frame, as in the clips that networks
//! learn from. What a window says (depth, confidence, motion score θ, cameras) goes into a file of its own (`stored.rs`), which appears
//! when it is whole and holds the digest of all that it depends on: network, weights, device, settings, and the window's pictures.
//! A run that was killed finds the windows that it had finished by these digests and computes the others. All that follows is a
//! function of these files, so a resumed run leaves the same files as one that was not, bit for bit.
//!
//! *Chain* (`chain.rs`). Neighbours see the same pixels of the images they share. `omnix_geometry::Shared` finds the scale from the depths, then
//! rotation and translation from the points, of pixels that both windows call still and are sure of. The earlier window's world is
//! kept, so the film's world is that of its first window. Two windows are not joined where the film is cut, where too few pixels
//! stand still, and where the points stay further apart than [`MOST_APART`] of their depth: there a new part of the film begins, with a world
//! of its own. Nothing is joined by guess. Every join, made or not, is told with its residuals ([`Seam`]).
//!
//! *Film* (`film.rs`). Each image comes out once, in order, in its part's world. In the images that two joined windows share, depth, confidence, θ and
//! camera go over from the one to the other in equal steps, so that there is no seam. Of windows that are kept apart, the earlier has the
//! first half of what they share. Memory: the maps of two images.
//!
//! *Points* (`follow.rs`). Where paths are wanted, every window's field is kept in a file too. A chosen pixel is followed by its own window's field; over a
//! seam it goes on where the next window shows the same place of the world, and is lost where none of the shared images does.
//! Saved (`film_field.rs`), the windows' fields and what joins them answer for any pixels and times of the film.

mod chain;
mod cuts;
mod film;
mod film_field;
mod follow;
mod layout;
mod run;
mod stored;
mod view;

pub use chain::{Apart, Chain, MOST_APART, Placement, Seam};
pub use cuts::Cuts;
pub use film::{Film, FilmImage};
pub use film_field::{FilmField, FilmFiles};
pub use follow::{Follow, Followed, OpenField, WindowField};
pub use layout::{Layout, Window};
pub use run::{Pictures, Windows, still_up_to, window_request};
pub use stored::{StoredWindow, field_path, window_path};
