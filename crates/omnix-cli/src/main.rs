//! The omnix program.
fn main() {}
