"""Whether stated uncertainties are true, judged by the truth."""
