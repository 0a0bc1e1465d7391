/* Rows of numbers as text: each double with the fewest decimal digits that read back to the same bits, and of those the
 * nearest to it, written as Python's repr() does.
 *
 * Digits by Schubfach (R. Giulietti, "The Schubfach way to render doubles", 2020): the value and the two ends of the
 * interval that rounds to it are scaled by one power of ten, kept as a 128-bit integer; at most one multiple of ten and
 * otherwise one of two neighbours lies inside. `powers` is made by csv_powers.py. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "csv_powers.h"

typedef struct { uint64_t digits; int exponent; } Decimal; /* digits * 10^exponent */

static uint64_t product_high(uint64_t a, uint64_t b, uint64_t *low)
{
    const uint64_t a0 = (uint32_t)a, a1 = a >> 32, b0 = (uint32_t)b, b1 = b >> 32;
    const uint64_t p00 = a0 * b0, p01 = a0 * b1, p10 = a1 * b0;
    const uint64_t middle = (p00 >> 32) + (uint32_t)p01 + (uint32_t)p10;

    *low = (middle << 32) | (uint32_t)p00;
    return a1 * b1 + (p01 >> 32) + (p10 >> 32) + (middle >> 32);
}

/* The integer part of power * c / 2^128, its last bit set where something is cut off. */
static uint64_t round_to_odd(const uint64_t power[2], uint64_t c)
{
    uint64_t low, ignored;
    const uint64_t carried = product_high(power[1], c, &ignored), high = product_high(power[0], c, &low);
    const uint64_t sum = low + carried;

    return (high + (sum < low)) | (sum > 1);
}

/* floor(n / 2^bits) of negative numbers too, whatever the compiler's >> does with them */
static int shifted(int64_t n, int bits)
{
    const int64_t unit = (int64_t)1 << bits;

    return (int)(n >= 0 ? n / unit : -((unit - 1 - n) / unit));
}

static Decimal shortest(uint64_t fraction, int biased)
{
    const uint64_t c = biased ? fraction | (uint64_t)1 << 52 : fraction;
    const int q = (biased ? biased : 1) - 1075, even = !(c & 1);
    const int nearer_below = !fraction && biased > 1;
    const int k = shifted((int64_t)q * 1262611 - (nearer_below ? 524031 : 0), 22);
    const int h = q + shifted((int64_t)-k * 1741647, 19) + 1;
    const uint64_t *power = powers[-k - FIRST_POWER];
    const uint64_t low = round_to_odd(power, (4 * c - 2 + (uint64_t)nearer_below) << h) + !even;
    const uint64_t value = round_to_odd(power, 4 * c << h);
    const uint64_t high = round_to_odd(power, (4 * c + 2) << h) - !even;
    const uint64_t s = value / 4, ten = s / 10;
    int below, above;

    if (s >= 10) {
        below = low <= 40 * ten;
        above = 40 * ten + 40 <= high;
        if (below != above)
            return (Decimal){ten + (uint64_t)above, k + 1};
    }
    below = low <= 4 * s;
    above = 4 * s + 4 <= high;
    if (below == above) { /* both or none: the nearer one, of equally near ones the even */
        const uint64_t middle = 4 * s + 2;
        above = value > middle || (value == middle && (s & 1));
    }
    return (Decimal){s + (uint64_t)above, k};
}

/* Digits without zeros at their end; returns how many, and how many stand before the point in `*point`. */
static int spell(Decimal d, char digits[20], int *point)
{
    char reversed[20];
    int count = 0;

    while (d.digits % 10 == 0)
        d.digits /= 10, ++d.exponent;
    for (; d.digits; d.digits /= 10)
        reversed[count++] = (char)('0' + d.digits % 10);
    for (int i = 0; i < count; ++i)
        digits[i] = reversed[count - 1 - i];
    *point = count + d.exponent;
    return count;
}

static char *fill(char *out, char c, int count)
{
    memset(out, c, (size_t)count);
    return out + count;
}

static char *copy(char *out, const char *from, int count)
{
    memcpy(out, from, (size_t)count);
    return out + count;
}

static char *write_exponent(char *out, int exponent)
{
    *out++ = 'e';
    *out++ = exponent < 0 ? '-' : '+';
    exponent = exponent < 0 ? -exponent : exponent;
    if (exponent >= 100)
        *out++ = (char)('0' + exponent / 100);
    *out++ = (char)('0' + exponent / 10 % 10);
    *out++ = (char)('0' + exponent % 10);
    return out;
}

static char *write_digits(char *out, const char *digits, int count, int point)
{
    if (point > 16 || point <= -4) {
        *out++ = digits[0];
        if (count > 1)
            *out++ = '.', out = copy(out, digits + 1, count - 1);
        return write_exponent(out, point - 1);
    }
    if (point <= 0) {
        out = copy(out, "0.", 2);
        return copy(fill(out, '0', -point), digits, count);
    }
    if (point >= count) {
        out = fill(copy(out, digits, count), '0', point - count);
        return copy(out, ".0", 2);
    }
    out = copy(out, digits, point);
    *out++ = '.';
    return copy(out, digits + point, count - point);
}

static char *write_number(char *out, double number)
{
    uint64_t bits;
    char digits[20];
    int count, point;

    memcpy(&bits, &number, sizeof bits);
    const uint64_t fraction = bits & (((uint64_t)1 << 52) - 1);
    const int biased = (int)(bits >> 52 & 2047);
    if (biased == 2047 && fraction)
        return copy(out, "nan", 3);
    if (bits >> 63)
        *out++ = '-';
    if (biased == 2047)
        return copy(out, "inf", 3);
    if (!biased && !fraction)
        return copy(out, "0.0", 3);
    count = spell(shortest(fraction, biased), digits, &point);
    return write_digits(out, digits, count, point);
}

/* Writes `rows` lines of `columns` numbers, commas between; returns the number of bytes. A number takes 25 at most, its
 * comma or line end included. */
size_t csv_rows(const double *data, size_t rows, size_t columns, char *out)
{
    char *end = out;

    for (size_t i = 0; i < rows; ++i) {
        for (size_t j = 0; j < columns; ++j) {
            end = write_number(end, *data++);
            *end++ = j + 1 < columns ? ',' : '\n';
        }
    }
    return (size_t)(end - out);
}
