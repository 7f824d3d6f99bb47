//! Shared bench harness.
