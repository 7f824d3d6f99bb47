//! The body of a loop leaves the loop's counter and bound alone.
//!
//! naga makes `for (var i = a; i < b; i += c)` a loop whose body begins with `if i < b {} else { break }` and whose continuing part
//! has the step. What the condition loads and what the continuing part stores are the counter and the bound; the rest of the
//! body must not store to them, also not through a pointer given to a function.

use std::collections::BTreeSet;

use naga::{Block, Expression, Function, Handle, LocalVariable, Module, Span, Statement};

type Locals = BTreeSet<Handle<LocalVariable>>;

/// Where a body stores to what the end of its loop depends on.
pub(super) fn check(module: &Module) -> Vec<(Span, String)> {
    let functions = module.functions.iter().map(|(_, function)| function);
    let entries = module.entry_points.iter().map(|entry| &entry.function);
    functions.chain(entries).flat_map(|function| in_block(function, &function.body)).collect()
}

/// Findings in all loops of a block.
fn in_block(function: &Function, block: &Block) -> Vec<(Span, String)> {
    let mut found = Vec::new();
    for (statement, span) in block.span_iter() {
        if let Statement::Loop { body, continuing, .. } = statement {
            let mut kept = Locals::new();
            each_store(function, continuing.iter(), &mut |local| _ = kept.insert(local));
            let Some(head) = head(body).filter(|_| !kept.is_empty()) else {
                found.push((*span, "a loop without a bound and a step in its head".to_owned()));
                continue;
            };
            let (head, rest) = body.split_at(head);
            head.iter().for_each(|statement| read_by(function, statement, &mut kept));
            each_store(function, rest.iter(), &mut |local| {
                if kept.contains(&local) {
                    let name = function.local_variables[local].name.as_deref().unwrap_or("a variable");
                    let what = format!("the body of this loop stores to `{name}`, on which the loop's end depends");
                    found.push((*span, what));
                }
            });
        }
        for inner in blocks(statement) {
            found.extend(in_block(function, inner));
        }
    }
    found
}

/// The blocks right below a statement.
fn blocks(statement: &Statement) -> Vec<&Block> {
    match statement {
        Statement::Block(block) => vec![block],
        Statement::If { accept, reject, .. } => vec![accept, reject],
        Statement::Switch { cases, .. } => cases.iter().map(|case| &case.body).collect(),
        Statement::Loop { body, continuing, .. } => vec![body, continuing],
        _ => Vec::new(),
    }
}

/// The number of statements in front of a body that are its condition: up to the `if` that breaks.
fn head(body: &Block) -> Option<usize> {
    let breaks = |block: &Block| block.iter().any(|statement| matches!(statement, Statement::Break));
    let ends = |statement: &Statement| matches!(statement, Statement::If { accept, reject, .. } if accept.is_empty() && breaks(reject));
    Some(body.iter().position(ends)? + 1)
}

/// Local variables that the condition of a loop loads. `&&` and `||` make it several statements.
fn read_by(function: &Function, statement: &Statement, into: &mut Locals) {
    match statement {
        Statement::If { condition, .. } => loads(function, *condition, into),
        Statement::Store { value, .. } => loads(function, *value, into),
        _ => {}
    }
    blocks(statement).into_iter().flat_map(|block| block.iter()).for_each(|inner| read_by(function, inner, into));
}

/// Calls `each` for every store to a local variable in statements and the blocks below, and for every pointer handed on.
fn each_store<'a>(
    function: &Function,
    statements: impl Iterator<Item = &'a Statement>,
    each: &mut dyn FnMut(Handle<LocalVariable>),
) {
    for statement in statements {
        let pointers: &[Handle<Expression>] = match statement {
            Statement::Store { pointer, .. } | Statement::Atomic { pointer, .. } => std::slice::from_ref(pointer),
            Statement::Call { arguments, .. } => arguments,
            _ => &[],
        };
        pointers.iter().filter_map(|pointer| local(function, *pointer)).for_each(&mut *each);
        blocks(statement).into_iter().for_each(|inner| each_store(function, inner.iter(), &mut *each));
    }
}

/// The local variable that a pointer points into.
fn local(function: &Function, pointer: Handle<Expression>) -> Option<Handle<LocalVariable>> {
    match function.expressions[pointer] {
        Expression::LocalVariable(local) => Some(local),
        Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => local(function, base),
        _ => None,
    }
}

/// Local variables that an expression loads.
fn loads(function: &Function, expression: Handle<Expression>, into: &mut Locals) {
    let mut of = |handle| loads(function, handle, into);
    match function.expressions[expression] {
        Expression::Load { pointer } => into.extend(local(function, pointer)),
        Expression::Unary { expr, .. } | Expression::As { expr, .. } => of(expr),
        Expression::Binary { left, right, .. } => [left, right].into_iter().for_each(of),
        Expression::Select { condition, accept, reject } => [condition, accept, reject].into_iter().for_each(of),
        Expression::Math { arg, arg1, arg2, arg3, .. } => {
            std::iter::once(arg).chain(arg1).chain(arg2).chain(arg3).for_each(of);
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::findings;

    #[test]
    fn bodies_that_move_their_loops_end_are_found() {
        for body in [
            "for (var n = 0u; n < p.n; n++) { if (x[n] == 1u) { n += 2u; } }",
            "for (var n = 0u; n < p.n; n++) { for (var m = 0u; m < 4u; m++) { n = m; } }",
            "for (var n = 0u; n < p.n; n++) { bump(&n); }",
            "var end = 9u; for (var n = 0u; n < end; n++) { end += x[n]; }",
            "var end = 9u; for (var n = 0u; n < min(end, p.n) && n < 7u; n++) { end = 4u; }",
        ] {
            let found = findings(body);
            assert!(found.len() == 1 && found[0].contains("the loop's end depends"), "{body}: {found:?}");
        }
        let found = findings("var n = 0u; loop { if (n > 9u) { break; } n++; }");
        assert!(found.len() == 1 && found[0].contains("without a bound"), "{found:?}");
    }

    #[test]
    fn bodies_that_leave_it_alone_are_not() {
        for body in [
            "var sum = 0u; for (var n = 0u; n < p.n; n++) { sum += n; }",
            "for (var n = 0u; n < p.n; n++) { for (var m = n; m < 64u; m += 8u) { y[m] = n; } }",
            "var at = 0u; for (var n = 0u; n < p.n; n++) { at += 3u; if (at > 9u) { break; } }",
        ] {
            assert_eq!(findings(body), Vec::<String>::new(), "{body}");
        }
    }
}
