//! Intervals of means and standard deviations of a few normal values.

/// The deviate that 97.5 % of a standard normal lie below.
const NORMAL: f64 = 1.959_964;

/// The same of Student's t with 1, 2, … degrees of freedom.
const STUDENT: [f64; 10] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228];

/// Of Student's t: from the table, beyond it by the first terms of Fisher's expansion.
pub(crate) fn student(freedom: usize) -> f64 {
    match STUDENT.get(freedom.wrapping_sub(1)) {
        Some(t) => *t,
        None if freedom == 0 => f64::INFINITY,
        None => {
            let (z, n) = (NORMAL, freedom as f64);
            let z3 = z * z * z;
            z + (z3 + z) / (4.0 * n) + (5.0 * z3 * z * z + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        }
    }
}

/// Half the width of the 95 % interval of the mean.
pub(crate) fn of_mean(sd: f64, count: usize) -> f64 {
    student(count.saturating_sub(1)) * sd / (count.max(1) as f64).sqrt()
}

/// The 95 % interval of a standard deviation that was estimated as 1, from the quantiles of χ² by Wilson and Hilferty
/// (doi:10.1073/pnas.17.12.684).
pub(crate) fn of_deviation(count: usize) -> [f64; 2] {
    let n = count.saturating_sub(1) as f64;
    if n < 1.0 {
        return [0.0, f64::INFINITY];
    }
    let chi2 = |z: f64| {
        let root = 1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt();
        n * (root * root * root).max(1e-3)
    };
    [NORMAL, -NORMAL].map(|z| (n / chi2(z)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_tables() {
        assert!((student(30) - 2.042).abs() < 0.002, "{}", student(30));
        assert!((student(11) - 2.201).abs() < 0.003, "{}", student(11));
        // χ² with 7 degrees of freedom: 1.690 and 16.013.
        let [low, high] = of_deviation(8);
        assert!(
            (low - (7.0_f64 / 16.013).sqrt()).abs() < 0.01 && (high - (7.0_f64 / 1.690).sqrt()).abs() < 0.05,
            "{low} {high}"
        );
        assert_eq!(of_deviation(1)[1], f64::INFINITY);
    }
}
