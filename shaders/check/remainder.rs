//! No `%` of a signed number that may be negative.

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{BinaryOperator, Expression, Function, Handle, Literal, MathFunction, Module, ScalarKind, Span};

/// Where a signed remainder is taken of something that is not known to be 0 or more.
pub(super) fn check(module: &Module, info: &ModuleInfo) -> Vec<(Span, String)> {
    let functions = module.functions.iter().map(|(handle, function)| (function, &info[handle]));
    let entries = module.entry_points.iter().enumerate().map(|(i, entry)| (&entry.function, info.get_entry_point(i)));
    functions.chain(entries).flat_map(|(function, info)| check_function(module, function, info)).collect()
}

fn check_function(module: &Module, function: &Function, info: &FunctionInfo) -> Vec<(Span, String)> {
    let mut found = Vec::new();
    for (handle, expression) in function.expressions.iter() {
        let Expression::Binary { op: BinaryOperator::Modulo, left, .. } = *expression else { continue };
        let signed = info[handle].ty.inner_with(&module.types).scalar_kind() == Some(ScalarKind::Sint);
        if signed && !at_least_zero(function, left) {
            let what = "`%` of a signed number that may be negative: clamp it first, or use u32".to_owned();
            found.push((function.expressions.get_span(handle), what));
        }
    }
    found
}

/// Whether an expression is 0 or more by its form.
fn at_least_zero(function: &Function, handle: Handle<Expression>) -> bool {
    let of = |handle| at_least_zero(function, handle);
    match function.expressions[handle] {
        Expression::Literal(Literal::I32(value)) => value >= 0,
        Expression::Literal(Literal::I64(value)) => value >= 0,
        Expression::Literal(Literal::AbstractInt(value)) => value >= 0,
        Expression::Splat { value, .. } => of(value),
        Expression::ZeroValue(_) => true,
        // Of a maximum one side is enough; a clamp has its lower bound second.
        Expression::Math { fun: MathFunction::Max, arg, arg1, .. } => of(arg) || arg1.is_some_and(of),
        Expression::Math { fun: MathFunction::Clamp, arg1, .. } => arg1.is_some_and(of),
        Expression::Math { fun: MathFunction::Min, arg, arg1, .. } => of(arg) && arg1.is_some_and(of),
        Expression::Binary { op: BinaryOperator::Modulo, left, .. } => of(left),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::findings;

    #[test]
    fn remainders_of_what_may_be_negative_are_found() {
        for body in ["let a = p.d % 3;", "let a = (p.d - 1) % p.d;", "let a = vec2<i32>(p.d) % vec2<i32>(2);"] {
            let found = findings(body);
            assert!(found.len() == 1 && found[0].contains("may be negative"), "{body}: {found:?}");
        }
    }

    #[test]
    fn others_are_not() {
        for body in
            ["let a = p.n % 3u;", "let a = max(p.d, 0) % 3;", "let a = clamp(p.d, 0, 9) % 4;", "let a = 1.5 % 1.0;"]
        {
            assert_eq!(findings(body), Vec::<String>::new(), "{body}");
        }
    }
}
