
ENERGY_FN @real @quadrant_if_huge(int huge, @real angle, @real ordinary) {
    return huge ? @huge_angle(angle, 0) : ordinary;
}

ENERGY_FN @real @high_remainder_if_huge(int huge, @real angle, @real ordinary) {
    return huge ? @huge_angle(angle, 1) : ordinary;
}

ENERGY_FN @real @low_remainder_if_huge(int huge, @real angle, @real ordinary) {
    return huge ? @huge_angle(angle, 2) : ordinary;
}
