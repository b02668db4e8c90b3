"""The paper behind the method, reproduced claim by claim: Nie et al., RCIM 37 (2016) 292-301."""
