//! What is changed in a source: each decision by a switch with a number.
//!
//! A comparison becomes its neighbour (`==` `!=`, `<` `<=`, `>` `>=`), `&&` and `||` become each other, a
//! store to a field does not happen, an early return does not return. All of them are in one build:
//! `mutant(7)` says whether the seventh is the one that is tried. What a macro is given, constants and tests
//! stay as they are.

use syn::spanned::Spanned as _;
use syn::visit_mut::{self, VisitMut};
use syn::{BinOp, Block, Expr, ExprIf, ImplItemFn, Item, ItemConst, ItemFn, ItemMod, Stmt, parse_quote};

/// A change, and where it is.
#[derive(Clone, Debug)]
pub struct Mutant {
    /// The file.
    pub file: String,
    /// Its line.
    pub line: usize,
    /// What is changed into what.
    pub what: String,
    /// It must not live.
    pub must_die: bool,
}

/// Changes a source; the mutants in it are added to those before.
pub fn change(file: &str, source: &str, mutants: &mut Vec<Mutant>) -> syn::Result<String> {
    let mut parsed = syn::parse_file(source)?;
    Changer { file, mutants }.visit_file_mut(&mut parsed);
    Ok(prettyplease::unparse(&parsed))
}

struct Changer<'m> {
    file: &'m str,
    mutants: &'m mut Vec<Mutant>,
}

impl Changer<'_> {
    /// The number of another mutant.
    fn number(&mut self, line: usize, what: String) -> u32 {
        self.mutants.push(Mutant { file: self.file.to_owned(), line, what, must_die: false });
        self.mutants.len() as u32
    }

    /// A statement that does not happen in a mutant.
    fn unless(&mut self, stmt: &Stmt) -> Stmt {
        let number = self.number(stmt.span().start().line, format!("without `{}`", short(stmt)));
        parse_quote! { if !crate::mutant(#number) { #stmt } }
    }
}

/// The beginning of a piece of source.
fn short(tokens: &impl quote::ToTokens) -> String {
    let text = tokens.to_token_stream().to_string();
    text.chars().take(60).collect()
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes
        .iter()
        .any(|attribute| attribute.path().is_ident("cfg") && short(&attribute.meta).contains("test"))
}

/// Whether this is a switch that was put in by hand.
fn is_switch(expression: &Expr) -> bool {
    match expression {
        Expr::Unary(unary) => is_switch(&unary.expr),
        Expr::Call(call) => short(&call.func) == "crate :: mutant",
        _ => false,
    }
}

/// Whether a condition binds something, so that it is no expression of its own.
fn binds(expression: &Expr) -> bool {
    match expression {
        Expr::Let(_) => true,
        Expr::Binary(binary) => binds(&binary.left) || binds(&binary.right),
        _ => false,
    }
}

impl VisitMut for Changer<'_> {
    fn visit_item_mut(&mut self, item: &mut Item) {
        if !matches!(item, Item::Macro(_) | Item::Static(_)) {
            visit_mut::visit_item_mut(self, item);
        }
    }

    fn visit_item_mod_mut(&mut self, module: &mut ItemMod) {
        if !is_test(&module.attrs) {
            visit_mut::visit_item_mod_mut(self, module);
        }
    }

    fn visit_item_const_mut(&mut self, _: &mut ItemConst) {}

    fn visit_item_fn_mut(&mut self, function: &mut ItemFn) {
        if function.sig.constness.is_none() && !is_test(&function.attrs) {
            visit_mut::visit_item_fn_mut(self, function);
        }
    }

    fn visit_impl_item_fn_mut(&mut self, function: &mut ImplItemFn) {
        if function.sig.constness.is_none() && !is_test(&function.attrs) {
            visit_mut::visit_impl_item_fn_mut(self, function);
        }
    }

    fn visit_expr_mut(&mut self, expression: &mut Expr) {
        visit_mut::visit_expr_mut(self, expression);
        let Expr::Binary(binary) = expression else { return };
        if is_switch(&binary.left) {
            return;
        }
        let other: BinOp = match binary.op {
            BinOp::Eq(_) => parse_quote!(!=),
            BinOp::Ne(_) => parse_quote!(==),
            BinOp::Lt(_) => parse_quote!(<=),
            BinOp::Le(_) => parse_quote!(<),
            BinOp::Gt(_) => parse_quote!(>=),
            BinOp::Ge(_) => parse_quote!(>),
            BinOp::And(_) if !binds(&binary.left) && !binds(&binary.right) => parse_quote!(||),
            BinOp::Or(_) => parse_quote!(&&),
            _ => return,
        };
        let (left, op, right) = (&binary.left, &binary.op, &binary.right);
        let what = format!("{} for {} behind `{}`", short(&other), short(op), short(left));
        let number = self.number(op.span().start().line, what);
        *expression =
            parse_quote! { (if crate::mutant(#number) { #left #other #right } else { #left #op #right }) };
    }

    fn visit_block_mut(&mut self, block: &mut Block) {
        visit_mut::visit_block_mut(self, block);
        for stmt in &mut block.stmts {
            let stores = match stmt {
                Stmt::Expr(Expr::Assign(assign), Some(_)) => {
                    matches!(*assign.left, Expr::Field(_) | Expr::Unary(_) | Expr::Tuple(_))
                }
                Stmt::Expr(Expr::Binary(binary), Some(_)) => matches!(*binary.left, Expr::Field(_)),
                _ => false,
            };
            if stores {
                *stmt = self.unless(stmt);
            }
        }
    }

    fn visit_expr_if_mut(&mut self, branch: &mut ExprIf) {
        visit_mut::visit_expr_if_mut(self, branch);
        if branch.else_branch.is_none()
            && let Some(last) = branch.then_branch.stmts.last_mut()
            && matches!(last, Stmt::Expr(Expr::Return(_), _))
        {
            *last = self.unless(last);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decisions_get_switches_and_tests_and_constants_do_not() {
        let source = "
            const LIMIT: bool = 1 < 2;
            fn decide(&mut self, a: u32) -> bool {
                if a == 1 && self.on { return false; }
                self.count += 1;
                let local = 3;
                if let Some(b) = self.b && b > a { self.b = None; }
                matches!(a, 1 | 2) || a < local
            }
            #[cfg(test)]
            mod tests { fn try_it() { assert!(1 == 1); if a == b { return; } } }
        ";
        let mut mutants = Vec::new();
        let changed = change("x.rs", source, &mut mutants).unwrap();
        let lines: Vec<usize> = mutants.iter().map(|mutant| mutant.line).collect();
        assert_eq!(lines, [4, 4, 4, 7, 7, 8, 8, 5], "{mutants:#?}");
        assert!(changed.contains("crate::mutant(8u32)") && !changed.contains("mutant(9"), "{changed}");
        assert!(changed.contains("const LIMIT: bool = 1 < 2;"));
    }
}
