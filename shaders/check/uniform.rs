//! No barrier that only some invocations of a workgroup reach.
//!
//! A value *varies* if it may differ between the invocations of a workgroup. As in WGSL's uniformity analysis, what is loaded from
//! uniforms and from read-only storage varies with its index alone; what is loaded from memory that shaders write varies, unless
//! through `workgroupUniformLoad`. A variable varies if anything stored to it does, or is stored where only some invocations are.
//! naga has no such analysis for barriers; browsers do, and refuse the shader.

use std::collections::HashMap;

use naga::{
    AddressSpace, Block, BuiltIn, Expression, Function, FunctionArgument, Handle, LocalVariable, Module, Span,
    Statement, StorageAccess,
};

/// Barriers that not all invocations reach, or may not reach together.
pub(super) fn check(module: &Module) -> Vec<(Span, String)> {
    let mut found = Vec::new();
    for entry in &module.entry_points {
        let arguments = entry.function.arguments.iter().map(varies_as_input).collect();
        found.extend(Walk::new(module, &entry.function, arguments).run(false).barriers);
    }
    found
}

fn varies_as_input(argument: &FunctionArgument) -> bool {
    !matches!(
        argument.binding,
        Some(naga::Binding::BuiltIn(
            BuiltIn::WorkGroupId | BuiltIn::WorkGroupSize | BuiltIn::NumWorkGroups | BuiltIn::NumSubgroups
        ))
    )
}

/// What calling a function does.
struct Outcome {
    barriers: Vec<(Span, String)>,
    result_varies: bool,
}

/// One function with arguments of known kind.
struct Walk<'a> {
    module: &'a Module,
    function: &'a Function,
    arguments: Vec<bool>,
    /// Local variables that vary; grows until nothing changes.
    locals: HashMap<Handle<LocalVariable>, bool>,
    /// Results of calls and atomics.
    results: HashMap<Handle<Expression>, bool>,
    known: HashMap<Handle<Expression>, bool>,
    result_varies: bool,
    /// Some invocations have returned.
    returned: bool,
    barriers: Vec<(Span, String)>,
}

impl<'a> Walk<'a> {
    fn new(module: &'a Module, function: &'a Function, arguments: Vec<bool>) -> Self {
        Self {
            module,
            function,
            arguments,
            locals: HashMap::new(),
            results: HashMap::new(),
            known: HashMap::new(),
            result_varies: false,
            returned: false,
            barriers: Vec::new(),
        }
    }

    /// Goes over the body until no more variables are found to vary; `apart` says that only some invocations called.
    fn run(mut self, apart: bool) -> Outcome {
        loop {
            let before = (self.locals.clone(), self.results.clone());
            (self.returned, self.barriers) = (false, Vec::new());
            self.known.clear();
            self.block(&self.function.body, apart);
            if before == (self.locals.clone(), self.results.clone()) {
                return Outcome { barriers: self.barriers, result_varies: self.result_varies };
            }
        }
    }

    /// Walks a block that only some invocations are in if `apart`; whether some may leave the enclosing loop or switch in it.
    fn block(&mut self, block: &'a Block, apart: bool) -> bool {
        let mut left = false;
        for (statement, span) in block.span_iter() {
            let apart = apart || left || self.returned;
            left |= self.statement(statement, *span, apart);
        }
        left
    }

    fn statement(&mut self, statement: &'a Statement, span: Span, apart: bool) -> bool {
        match statement {
            Statement::Block(block) => return self.block(block, apart),
            Statement::If { condition, accept, reject } => {
                let apart = apart || self.varies(*condition);
                let left = self.block(accept, apart);
                return self.block(reject, apart) || left;
            }
            Statement::Switch { selector, cases } => {
                let apart = apart || self.varies(*selector);
                // A `break` ends the switch; a `continue` ends the turn of the loop around it.
                let mut left = false;
                for case in cases {
                    self.block(&case.body, apart);
                    left |= apart && continues(&case.body);
                }
                return left;
            }
            Statement::Loop { body, continuing, .. } => {
                let returned = self.returned;
                // When some leave in a turn, only the others are in the next.
                if self.block(body, apart) || self.returned != returned {
                    self.block(body, true);
                    self.block(continuing, true);
                } else {
                    self.block(continuing, apart);
                }
            }
            Statement::Break | Statement::Continue => return apart,
            Statement::Return { value } => {
                self.returned |= apart;
                self.result_varies |= apart || value.is_some_and(|value| self.varies(value));
            }
            Statement::ControlBarrier(_) => self.barrier(span, apart),
            Statement::WorkGroupUniformLoad { pointer, result } => {
                let apart = apart || self.varies(*pointer);
                self.barrier(span, apart);
                self.results.insert(*result, false);
            }
            Statement::Store { pointer, value } => {
                let varies = apart || self.varies(*value) || self.varies(*pointer);
                self.store(*pointer, varies);
            }
            Statement::Atomic { pointer, result, .. } => {
                self.store(*pointer, true);
                self.results.extend(result.map(|result| (result, true)));
            }
            Statement::Call { function, arguments, result } => self.call(*function, arguments, *result, apart),
            _ => {}
        }
        false
    }

    fn call(
        &mut self,
        function: Handle<Function>,
        arguments: &[Handle<Expression>],
        result: Option<Handle<Expression>>,
        apart: bool,
    ) {
        let given = arguments.iter().map(|argument| self.varies(*argument)).collect();
        let outcome = Walk::new(self.module, &self.module.functions[function], given).run(apart);
        self.barriers.extend(outcome.barriers);
        // What a function does through a pointer is not followed.
        arguments.iter().for_each(|argument| self.store(*argument, true));
        self.results.extend(result.map(|result| (result, outcome.result_varies)));
    }

    fn barrier(&mut self, span: Span, apart: bool) {
        if apart {
            let what = "a barrier that not all invocations of a workgroup reach: what decides must not depend on the invocation or \
                        on memory that shaders write (workgroupUniformLoad makes it the same for all)";
            // A loop is walked twice when some invocations may leave it.
            if self.barriers.iter().all(|(known, _)| *known != span) {
                self.barriers.push((span, what.to_owned()));
            }
        }
    }

    /// Notes what is stored through a pointer to a local variable.
    fn store(&mut self, pointer: Handle<Expression>, varies: bool) {
        match self.function.expressions[pointer] {
            Expression::LocalVariable(local) => *self.locals.entry(local).or_default() |= varies,
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => self.store(base, varies),
            _ => {}
        }
    }

    fn varies(&mut self, handle: Handle<Expression>) -> bool {
        if let Some(known) = self.known.get(&handle) {
            return *known;
        }
        let varies = self.look(handle);
        // A variable may yet be found to vary in this pass; loads are looked at again.
        if !matches!(self.function.expressions[handle], Expression::Load { .. }) || varies {
            self.known.insert(handle, varies);
        }
        varies
    }

    fn look(&mut self, handle: Handle<Expression>) -> bool {
        match self.function.expressions[handle] {
            Expression::Literal(_)
            | Expression::Constant(_)
            | Expression::Override(_)
            | Expression::ZeroValue(_)
            | Expression::GlobalVariable(_)
            | Expression::LocalVariable(_)
            | Expression::ArrayLength(_)
            | Expression::WorkGroupUniformLoadResult { .. } => false,
            Expression::FunctionArgument(index) => self.arguments[index as usize],
            Expression::CallResult(_) | Expression::AtomicResult { .. } => {
                self.results.get(&handle).copied().unwrap_or(false)
            }
            Expression::Compose { ref components, .. } => components.iter().any(|part| self.varies(*part)),
            Expression::Access { base, index } => self.varies(base) || self.varies(index),
            Expression::AccessIndex { base, .. } => self.varies(base),
            Expression::Splat { value, .. } => self.varies(value),
            Expression::Swizzle { vector, .. } => self.varies(vector),
            Expression::Load { pointer } => self.memory_varies(pointer) || self.varies(pointer),
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => self.varies(expr),
            Expression::Binary { left, right, .. } => self.varies(left) || self.varies(right),
            Expression::Select { condition, accept, reject } => {
                self.varies(condition) || self.varies(accept) || self.varies(reject)
            }
            Expression::Relational { argument, .. } => self.varies(argument),
            Expression::Math { arg, arg1, arg2, arg3, .. } => {
                self.varies(arg) || [arg1, arg2, arg3].into_iter().flatten().any(|argument| self.varies(argument))
            }
            // Subgroups, matrices and what these shaders do not use.
            _ => true,
        }
    }

    /// Whether what a pointer points to varies, whatever the index.
    fn memory_varies(&self, pointer: Handle<Expression>) -> bool {
        match self.function.expressions[pointer] {
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => self.memory_varies(base),
            Expression::LocalVariable(local) => self.locals.get(&local).copied().unwrap_or(false),
            Expression::GlobalVariable(global) => match self.module.global_variables[global].space {
                AddressSpace::Uniform | AddressSpace::Immediate => false,
                AddressSpace::Storage { access } => access.contains(StorageAccess::STORE),
                _ => true,
            },
            _ => true,
        }
    }
}

/// Whether a block has a `continue` of the loop around it.
fn continues(block: &Block) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Continue => true,
        Statement::Block(block) => continues(block),
        Statement::If { accept, reject, .. } => continues(accept) || continues(reject),
        Statement::Switch { cases, .. } => cases.iter().any(|case| continues(&case.body)),
        _ => false,
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::findings;

    #[test]
    fn barriers_that_not_all_reach_are_found() {
        for body in [
            "if (i < 3u) { workgroupBarrier(); }",
            "if (y[0] > 3u) { workgroupBarrier(); }",
            "if (x[i] > 3u) { workgroupBarrier(); }",
            "if (w[0] > 3u) { workgroupBarrier(); }",
            "if (i > 3u) { return; } workgroupBarrier();",
            "for (var n = i; n < p.n; n += 64u) { workgroupBarrier(); }",
            "for (var n = 0u; n < p.n; n++) { if (y[n] == 0u) { break; } workgroupBarrier(); }",
            "for (var n = 0u; n < p.n; n++) { workgroupBarrier(); if (y[n] == 0u) { break; } }",
            "for (var n = 0u; n < p.n; n++) { workgroupBarrier(); if (y[n] == 0u) { return; } }",
            "for (var n = 0u; n < p.n; n++) { if (y[n] == 0u) { continue; } workgroupBarrier(); }",
            "var late = 0u; for (var n = 0u; n < p.n; n++) { if (late > 2u) { workgroupBarrier(); } late = y[n]; }",
            "var a = 0u; if (i == 0u) { a = 1u; } if (a == 1u) { workgroupBarrier(); }",
            "switch y[0] { case 1u: { workgroupBarrier(); } default: {} }",
            "if (y[0] > 3u && p.n > 2u) { workgroupBarrier(); }",
            "if (i == 0u) { y[0] = meet(1u); }",
            "if (twice(i) > 4u) { workgroupBarrier(); }",
            "var a = 0u; bump(&a); if (a == 1u) { workgroupBarrier(); }",
            "if (i == 0u) { y[0] = workgroupUniformLoad(&w[0]); }",
        ] {
            let found = findings(body);
            assert!(!found.is_empty() && found.iter().all(|f| f.contains("not all invocations")), "{body}: {found:?}");
        }
    }

    #[test]
    fn barriers_that_all_reach_are_not() {
        for body in [
            "if (p.n < 3u) { workgroupBarrier(); }",
            "if (x[group.x] > 3u) { workgroupBarrier(); }",
            "if (group.x > p.n) { return; } workgroupBarrier();",
            "for (var n = 0u; n < p.n; n++) { if (x[n] == 0u) { break; } workgroupBarrier(); }",
            "for (var n = 0u; n < p.n; n++) { if (y[i] == 0u) { w[i] = n; } workgroupBarrier(); }",
            "for (var n = i; n < p.n; n += 64u) { if (y[n] == 0u) { break; } } workgroupBarrier();",
            "if (workgroupUniformLoad(&w[0]) > 3u) { workgroupBarrier(); }",
            "if (twice(p.n) > 4u) { y[i] = meet(i); }",
            "switch p.n { case 1u: { workgroupBarrier(); } default: {} }",
        ] {
            assert_eq!(findings(body), Vec::<String>::new(), "{body}");
        }
    }
}
