/* tail.h -- tail probabilities that a verdict on one new shape needs. */
#ifndef APSM_FIT_TAIL_H
#define APSM_FIT_TAIL_H

/* P(F > f) for F distributed with a and b degrees of freedom; f >= 0. */
double fit_tail_f(double f, double a, double b);

/* P(distance^2 > d2) for the squared Mahalanobis distance of one more shape from the mean of
 * shapes whose covariance (divisor shapes - 1) is estimated in m < shapes dimensions (Hotelling):
 *   d2 shapes (shapes - m) / ((shapes + 1) (shapes - 1) m)  ~  F(m, shapes - m)            (45) */
double fit_tail_mahalanobis(double d2, double shapes, double m);

#endif
