//! Which of the daemons that answered is taken for which robot. Pure.

/// A daemon that answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Claim<'a> {
    /// Where it is.
    pub address: &'a str,
    /// The robot it says it is of.
    pub says: &'a str,
    /// Whether it is the one that was taken for that robot before.
    pub is_known: bool,
}

/// For each daemon, `Err` with the reason if another says the same name: then it is not known which is meant, unless
/// one was taken for that robot before.
#[must_use]
pub fn settle(claims: &[Claim]) -> Vec<Result<(), String>> {
    let judge = |(number, claim): (usize, &Claim)| {
        let others = claims.iter().enumerate().filter(|(other, _)| *other != number);
        let mut same = others.map(|(_, other)| other).filter(|other| other.says == claim.says);
        match same.next() {
            Some(other) if !claim.is_known => Err(format!(
                "{} says that it is {}, too: give each robot a name of its own (fleet.robot)",
                other.address, claim.says
            )),
            _ => Ok(()),
        }
    };
    claims.iter().enumerate().map(judge).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_that_say_one_name_neither_is_taken_unless_one_was_before() {
        let claim = |address, says, is_known| Claim { address, says, is_known };
        let settled =
            |claims: &[Claim]| -> Vec<bool> { settle(claims).iter().map(Result::is_ok).collect() };
        let (a, b, c) =
            (claim("a:1", "kiwi", false), claim("b:1", "kiwi", false), claim("c:1", "lime", false));
        assert_eq!(settled(&[a, b, c]), [false, false, true]);
        assert_eq!(settled(&[a, Claim { is_known: true, ..b }, c]), [false, true, true]);
        let why = settle(&[a, b])[0].clone().expect_err("not known which");
        assert!(why.contains("b:1") && why.contains("kiwi"), "{why}");
    }
}
