//! Configurations of both formats, good and bad.

use omnix_model::config::{DepthUnit, Family, FeedForward, GaussianConfig, HeadKind, PointsFrom, TimeConfig};
use omnix_model::{Network, NetworkConfig, ReferenceChoice};
use serde_json::{Value, json};

use crate::fixture;

#[test]
fn reduced_networks_are_read_from_the_tree() {
    let a = fixture::config("tiny-a");
    assert_eq!((a.name.as_str(), a.family), ("tiny-a", Family::DepthAnything3));
    let b = &a.backbone;
    assert_eq!((b.width, b.blocks, b.heads, b.position_grid, b.alternate_from), (64, 10, 2, 37, Some(2)));
    assert_eq!((b.ffn, b.out_layers, b.time), (FeedForward::Mlp { hidden: 256 }, [3, 5, 7, 9], None));
    assert_eq!((b.qk_norm_from, b.rope_from), (Some(2), Some(2)));
    assert_eq!((a.head.features, a.head.channels, a.head.logit_clamp), (32, [16, 24, 32, 48], None));
    assert!(a.camera_encoder.is_some() && a.gaussians.is_none());

    let b = fixture::config("tiny-b");
    assert_eq!((b.backbone.ffn, b.backbone.alternate_from), (FeedForward::SwiGlu { hidden: 344 }, Some(3)));
    assert_eq!(b.gaussians, Some(GaussianConfig { features: 32, channels: [24, 40, 48, 64] }));
    let global: Vec<usize> = (0..8).filter(|i| b.backbone.is_global(*i)).collect();
    assert_eq!(global, [3, 5, 7], "an odd start is itself global");
}

#[test]
fn omnix_is_read() {
    let mixed = fixture::config("mixed");
    assert_eq!((mixed.family, mixed.key_prefix()), (Family::OmniX, Some("net.")));
    assert_eq!(mixed.backbone.time, Some(TimeConfig { from: 5, base: 100.0 }));
    assert_eq!(mixed.backbone.ffn, FeedForward::SwiGlu { hidden: 128 });
    assert_eq!((mixed.head.logit_clamp, mixed.points), (Some(10.0), PointsFrom::Rays));
    assert!(mixed.camera_encoder.is_none());
    assert!(mixed.gaussians.is_none());
    assert_eq!(Network::new(mixed).default_reference(), ReferenceChoice::First);

    let nano = NetworkConfig::from_json(&fixture::nano()).unwrap();
    assert_eq!((nano.backbone.width, nano.backbone.blocks, nano.backbone.head_dim()), (192, 6, 64));
    fixture::config("single-video");
}

#[test]
fn a_known_name_decides_and_a_tree_may_stand_alone() {
    for (name, expected) in [
        ("da3-small", NetworkConfig::small()),
        ("da3-base", NetworkConfig::base()),
        ("DA3-LARGE", NetworkConfig::large()),
        ("da3-giant", NetworkConfig::giant()),
        ("da3-giant-1.1", NetworkConfig::giant()),
    ] {
        assert_eq!(NetworkConfig::from_json(&json!({ "model_name": name })).unwrap(), expected, "{name}");
        expected.check().unwrap();
    }
    // The tree says something else: upstream does not look at it.
    let mut tree = fixture::json("tiny-a");
    tree["model_name"] = json!("da3-small");
    assert_eq!(NetworkConfig::from_json(&tree).unwrap(), NetworkConfig::small());

    let only_tree = json!({ "config": fixture::json("tiny-a")["config"] });
    let read = NetworkConfig::from_json(&only_tree).unwrap();
    assert_eq!(read.backbone, fixture::config("tiny-a").backbone);
    assert_eq!(NetworkConfig::from_json(&only_tree["config"]).unwrap(), read);
}

#[test]
fn a_published_encoder_in_a_tree_has_its_widths() {
    let mut tree = fixture::json("tiny-a");
    tree["config"]["net"]["name"] = json!("vits");
    tree["config"]["net"]["out_layers"] = json!([5, 7, 9, 11]);
    tree["config"]["head"]["dim_in"] = json!(768);
    tree["config"]["cam_enc"]["dim_out"] = json!(384);
    tree["config"]["cam_dec"]["dim_in"] = json!(768);
    let read = NetworkConfig::from_json(&tree).unwrap();
    assert_eq!((read.backbone.width, read.backbone.blocks, read.backbone.heads), (384, 12, 6));
}

#[test]
fn networks_of_single_views_and_nested_ones_are_read() {
    let mono = fixture::config("tiny-mono");
    assert_eq!((mono.head.kind, mono.backbone.alternate_from, mono.unit), (HeadKind::Sky, None, DepthUnit::Own));
    assert_eq!((mono.backbone.feature_width(), mono.makes_cameras(), mono.makes_sky()), (64, false, true));
    assert!(mono.camera_encoder.is_none() && (0..8).all(|i| !mono.backbone.is_global(i)));

    let nested = fixture::config("tiny-nested");
    let metric = nested.metric.as_ref().unwrap();
    assert_eq!((nested.name.as_str(), nested.unit, nested.backbone.blocks), ("tiny-nested", DepthUnit::Metres, 6));
    assert!(nested.makes_cameras() && nested.makes_sky() && nested.camera_encoder.is_some());
    assert_eq!((metric.at.path(), metric.unit, metric.backbone.blocks), ("da3_metric", DepthUnit::Canonical, 4));
    assert!(!metric.makes_cameras());

    for (name, expected) in
        [("da3metric-large", NetworkConfig::metric()), ("DA3NESTED-GIANT-LARGE-1.1", NetworkConfig::nested())]
    {
        assert_eq!(NetworkConfig::from_json(&json!({ "model_name": name })).unwrap(), expected, "{name}");
        expected.check().unwrap();
    }
    let mono = NetworkConfig::from_json(&json!({ "model_name": "DA3MONO-LARGE" })).unwrap();
    assert_eq!((mono.unit, mono.backbone), (DepthUnit::Own, NetworkConfig::metric().backbone));
}

/// The message when the field at `pointer` becomes `value` (or goes, for `None`).
fn message(name: &str, pointer: &str, value: Option<Value>) -> String {
    let mut json = fixture::json(name);
    let (parent, field) = pointer.rsplit_once('/').unwrap();
    let parent = json.pointer_mut(parent).unwrap().as_object_mut().unwrap();
    match value {
        Some(value) => parent.insert(field.to_owned(), value),
        None => parent.remove(field),
    };
    NetworkConfig::from_json(&json).unwrap_err().to_string()
}

#[test]
fn bad_fields_are_named_with_value_and_cure() {
    let cases = [
        ("tiny-a", "/config/net/num_heads", Some(json!(3)), "`net.num_heads` is 3: the width 64 must split"),
        (
            "tiny-a",
            "/config/net/embed_dim",
            Some(json!("64")),
            "`config.net.embed_dim` is \"64\": a whole number is needed",
        ),
        ("tiny-a", "/config/net/embed_dim", Some(json!(u64::MAX)), "it can be 1 to 65536"),
        (
            "tiny-a",
            "/config/net/depth",
            Some(json!(8)),
            "`net.out_layers` is [3, 5, 7, 9]: rising numbers of the 8 blocks",
        ),
        ("tiny-a", "/config/net/out_layers", Some(json!([1, 2, 3])), "four whole numbers are needed"),
        ("tiny-a", "/config/net/out_layers", Some(json!([5, 3, 7, 9])), "rising numbers"),
        ("tiny-a", "/config/net/alt_start", Some(json!(1)), "`net.alt_start` is 1: it can be 2 to 9"),
        ("tiny-a", "/config/net/name", Some(json!("vitx")), "it can be vits, vitb, vitl, vitg or custom"),
        ("tiny-a", "/config/net/ffn_layer", Some(json!("moe")), "it can be mlp or swiglufused"),
        ("tiny-a", "/config/net", None, "has no `config.net`: an object is needed"),
        ("tiny-a", "/config/head/dim_in", Some(json!(64)), "`config.head.dim_in` is 64: it must be 128"),
        ("tiny-a", "/config/head/features", Some(json!(20)), "`head.features` is 20: a multiple of 8 is needed"),
        (
            "tiny-a",
            "/config/head/out_channels",
            Some(json!([16, 24, 30, 48])),
            "`head.out_channels` is [16, 24, 30, 48]",
        ),
        ("tiny-a", "/config/cam_dec", None, "has no `config.cam_dec`"),
        (
            "tiny-a",
            "/config/net/cat_token",
            Some(json!(false)),
            "`config.net.cat_token` is false: it must be true where",
        ),
        ("tiny-b", "/config/gs_head/output_dim", Some(json!(83)), "`config.gs_head.output_dim` is 83: it must be 38"),
        ("tiny-b", "/config/gs_head/features", Some(json!(20)), "`gs_head.features` is 20: a multiple of 8"),
        ("tiny-mono", "/config/net/cat_token", Some(json!(true)), "it must be true where blocks alternate"),
        ("tiny-mono", "/config/head/__object__/name", Some(json!("DualDPT")), "others with DPT"),
        ("tiny-mono", "/config/head/dim_in", Some(json!(128)), "it must be 64, the encoder's width"),
        ("tiny-nested", "/config/metric", None, "has no `config.metric`: an object is needed"),
        (
            "tiny-nested",
            "/config/metric",
            Some(fixture::json("tiny-nested")["config"]["anyview"].clone()),
            "`config.metric`",
        ),
        ("tiny-a", "/model_name", Some(json!(3)), "`model_name` is 3: a text is needed"),
        ("mixed", "/format", Some(json!("omnix-2")), "`format` is \"omnix-2\": it can be omnix-1"),
        ("mixed", "/variant", Some(json!("paper")), "`variant` is \"paper\": it can be release"),
        ("mixed", "/colour", Some(json!("red")), "`colour` is \"red\": no such field; there are format, "),
        ("mixed", "/backbone/widht", Some(json!(1)), "`backbone.widht` is 1: no such field"),
        ("mixed", "/backbone/patch", Some(json!(16)), "`backbone.patch` is 16: it can be 14"),
        ("mixed", "/backbone/heads", Some(json!(0)), "`backbone.heads` is 0"),
        ("mixed", "/backbone/heads", Some(json!(24)), "must split into heads of 4, 8, .. 128 channels"),
        ("mixed", "/backbone/mlp_ratio", Some(json!(u64::MAX)), "`backbone.mlp_ratio`"),
        ("mixed", "/backbone/concat_local", Some(json!(false)), "`backbone.concat_local` is false: it can be true"),
        ("mixed", "/backbone/reference_view", Some(json!("middle")), "it can be first"),
        ("mixed", "/backbone/rope_base", Some(json!(0.5)), "`backbone.rope_base` is 0.5: a number above 1"),
        ("mixed", "/backbone/time/from", Some(json!(9)), "`backbone.time.from` is 9: it can be 0 to 8"),
        ("mixed", "/backbone/position_grid", Some(json!(0)), "`backbone.position_grid` is 0"),
        ("mixed", "/depth_head/aux_convs", Some(json!(4)), "`depth_head.aux_convs` is 4"),
        ("mixed", "/depth_head/logit_clamp", Some(json!(-1)), "`depth_head.logit_clamp` is -1"),
        ("mixed", "/points_from", None, "has no `points_from`: it can be rays or camera"),
        ("mixed", "/trajectory", Some(json!(7)), "`trajectory` is 7: an object is needed"),
    ];
    for (name, pointer, value, expected) in cases {
        let message = message(name, pointer, value);
        assert!(message.contains(expected), "{name} {pointer}: {message}");
    }
}

#[test]
fn what_is_no_configuration_says_so() {
    for (json, expected) in [
        (json!([1]), "`the whole` is [1]: an object is needed"),
        (json!({}), "neither the `model_name` of a published network, nor a tree `config`, nor `format` \"omnix-1\""),
        (json!({ "model_name": "mine" }), "neither the `model_name`"),
    ] {
        let message = NetworkConfig::from_json(&json).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }
    // Long values are shortened.
    let message = message("mixed", "/variant", Some(json!("x".repeat(1000))));
    assert!(message.len() < 200, "{message}");
}

#[test]
fn features_that_may_be_off() {
    let mut json = fixture::json("mixed");
    json["backbone"]["time"] = Value::Null;
    json["backbone"]["rope_from"] = json!(-1);
    json["depth_head"]["logit_clamp"] = Value::Null;
    json["trajectory"] = Value::Null;
    let config = NetworkConfig::from_json(&json).unwrap();
    assert_eq!((config.backbone.time, config.backbone.rope_from, config.head.logit_clamp), (None, None, None));
    assert!(config.trajectory.is_none());
}
