//! The data sets that are read, by name.

/// A data set, or a layout that several share.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Set {
    /// The paper's own set, drawn by a game engine.
    Ue,
    /// PointOdyssey.
    PointOdyssey,
    /// Waymo Open.
    Waymo,
    /// OmniGame.
    OmniGame,
    /// Dynamic Replica.
    DynamicReplica,
    /// DL3DV.
    Dl3dv,
    /// Stereo4D.
    Stereo4d,
    /// Spring.
    Spring,
    /// HOI4D.
    Hoi4d,
    /// DROID.
    Droid,
    /// The layout that newer trainers share, and ours.
    Shared,
    /// What `omnix reconstruct` writes.
    Output,
}

impl Set {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Ue,
        Self::PointOdyssey,
        Self::Waymo,
        Self::OmniGame,
        Self::DynamicReplica,
        Self::Dl3dv,
        Self::Stereo4d,
        Self::Spring,
        Self::Hoi4d,
        Self::Droid,
        Self::Shared,
        Self::Output,
    ];

    /// Its name on a command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ue => "ue",
            Self::PointOdyssey => "pointodyssey",
            Self::Waymo => "waymo",
            Self::OmniGame => "omnigame",
            Self::DynamicReplica => "dynamic-replica",
            Self::Dl3dv => "dl3dv",
            Self::Stereo4d => "stereo4d",
            Self::Spring => "spring",
            Self::Hoi4d => "hoi4d",
            Self::Droid => "droid",
            Self::Shared => "shared",
            Self::Output => "output",
        }
    }

    /// The set of this name.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|set| set.name() == name)
    }

    /// Whether samples of this set have dense paths.
    pub(crate) const fn has_dense_paths(self) -> bool {
        matches!(self, Self::Ue | Self::Waymo)
    }

    /// Whether the moving masks of this set may stand in for unknown paths (`spec/omnix.md` 11.2).
    #[must_use]
    pub const fn trusts_masks(self) -> bool {
        !matches!(self, Self::OmniGame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back() {
        for set in Set::ALL {
            assert_eq!(Set::of_name(set.name()), Some(set));
        }
        assert_eq!(Set::of_name("kitti"), None);
    }
}
