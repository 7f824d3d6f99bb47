//! What naga's validator lets pass and browsers, drivers or wgpu do not: run over every variant when this crate is built.
//!
//! - `uniform`: a barrier that not all invocations of a workgroup reach together (browsers refuse it, GPUs hang);
//! - `loops`: a loop whose body changes what its end depends on (shaders are made without wgpu's loop counters, so every
//!   loop must end by its head alone);
//! - `remainder`: `%` of a signed number that may be negative (drivers disagree about its sign).

mod loops;
mod remainder;
mod uniform;

use naga::Span;
use naga::valid::ModuleInfo;

/// All findings in a valid module, one line each, with the line of `wgsl` that it is about.
pub(crate) fn check(module: &naga::Module, info: &ModuleInfo, wgsl: &str) -> Vec<String> {
    let mut findings = Vec::new();
    let say = |(span, what): (Span, String)| {
        let line = span.location(wgsl).line_number;
        let text = wgsl.lines().nth(line.saturating_sub(1) as usize).unwrap_or_default().trim();
        format!("line {line} of the composed text: {what}\n    {text}")
    };
    findings.extend(uniform::check(module).into_iter().map(say));
    findings.extend(loops::check(module).into_iter().map(say));
    findings.extend(remainder::check(module, info).into_iter().map(say));
    findings
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::check;

    /// Findings in the body of a compute shader of 64 invocations; it must be one that naga accepts.
    pub(super) fn findings(body: &str) -> Vec<String> {
        let wgsl = format!(
            "struct Params {{ n: u32, d: i32 }}
            @group(0) @binding(0) var<uniform> p: Params;
            @group(0) @binding(1) var<storage, read> x: array<u32>;
            @group(0) @binding(2) var<storage, read_write> y: array<u32>;
            var<workgroup> w: array<u32, 64>;
            fn meet(v: u32) -> u32 {{ w[0] = v; workgroupBarrier(); return v; }}
            fn twice(v: u32) -> u32 {{ return v * 2u; }}
            fn bump(v: ptr<function, u32>) {{ *v += 1u; }}
            @compute @workgroup_size(64)
            fn main(@builtin(local_invocation_index) i: u32, @builtin(workgroup_id) group: vec3<u32>) {{
                {body}
            }}"
        );
        let module = naga::front::wgsl::parse_str(&wgsl).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&wgsl)));
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(&wgsl)));
        check(&module, &info, &wgsl)
    }

    #[test]
    fn a_finding_names_its_line() {
        let found = findings("if (i < 3u) {\n workgroupBarrier();\n }");
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(
            found[0].starts_with("line 12 of the composed text") && found[0].ends_with("workgroupBarrier();"),
            "{found:?}"
        );
    }

    #[test]
    fn plain_code_has_no_findings() {
        let body = "for (var n = i; n < p.n; n += 64u) { w[i] = x[n]; }
            workgroupBarrier();
            var sum = 0u;
            for (var n = 0u; n < 64u; n++) { sum += w[n]; }
            y[i] = sum % 7u;";
        assert_eq!(findings(body), Vec::<String>::new());
    }
}
