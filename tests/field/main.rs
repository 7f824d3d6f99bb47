//! Trajectories through the library: the field on the device, in a file, saved and opened, gives the same bits whatever the
//! chunks; and collections and networks that are odd but legal.

#![expect(clippy::unwrap_used, reason = "a failed helper is a failed test")]

mod bits;
mod file;
mod large;
mod made;
mod odd;
mod resident;
