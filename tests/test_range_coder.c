#include "check.h"
#include "range_coder.h"
#include <stdlib.h>
#include <string.h>

static uint32_t state = 1;
static uint32_t random32(void) {
    state ^= state << 13;
    state ^= state >> 17;
    return state ^= state << 5;
}

typedef struct symbol { uint32_t p1; int bit; } symbol;

static void encode(lathe_range_encoder *e, const symbol *symbols, size_t count) {
    lathe__encoder_start(e);
    for (size_t i = 0; i < count; i++) lathe__encode_bit(e, symbols[i].p1, symbols[i].bit);
    lathe__encoder_finish(e);
    CHECK(!e->failed);
}

static size_t round_trip(const symbol *symbols, size_t count) {
    lathe_range_encoder e;
    encode(&e, symbols, count);
    uint8_t *exact = malloc(e.size + 1);   /* so that a sanitizer sees a byte too many */
    memcpy(exact, e.bytes ? e.bytes : (const uint8_t *)"", e.size);
    lathe_range_decoder d;
    lathe__decoder_start(&d, exact, e.size);
    size_t wrong = 0;
    for (size_t i = 0; i < count; i++) wrong += lathe__decode_bit(&d, symbols[i].p1) != symbols[i].bit;
    CHECK_EQ(wrong, 0);
    CHECK(d.at == d.end || e.size <= 4);
    CHECK(d.overrun <= 8);
    size_t size = e.size;
    free(exact);
    lathe__encoder_free(&e);
    return size;
}

enum { MANY = 20000 };
static symbol symbols[MANY];

static void test_nothing(void) { CHECK_EQ(round_trip(symbols, 0), 0); }

static void test_every_short_string(void) {
    static const uint32_t chances[] = {1, 255, 32768, 65280, 65535};
    for (uint32_t p = 0; p < 5; p++)
        for (uint32_t bits = 0; bits < 1024; bits++) {
            for (uint32_t i = 0; i < 10; i++) symbols[i] = (symbol){chances[p], (int)(bits >> i & 1)};
            round_trip(symbols, bits % 11);
        }
}

static void test_fair_bits_cost_one_bit(void) {
    for (size_t i = 0; i < MANY; i++) symbols[i] = (symbol){32768, (int)(random32() >> 31)};
    size_t size = round_trip(symbols, MANY);
    CHECK(size >= MANY / 8 - 4 && size <= MANY / 8 + 2);
}

static void test_foreseen_bits_cost_nothing(void) {
    for (size_t i = 0; i < MANY; i++) symbols[i] = (symbol){i & 1 ? 65535 : 1, (int)(i & 1)};
    CHECK(round_trip(symbols, MANY) <= 2);   /* 20000 * 2.2e-5 bits */
}

static void test_unforeseen_bits_cost_sixteen(void) {
    for (size_t i = 0; i < 1000; i++) symbols[i] = (symbol){i & 1 ? 65535 : 1, !(i & 1)};
    size_t size = round_trip(symbols, 1000);
    CHECK(size >= 1990 && size <= 2004);
}

static void test_random_chances(void) {
    for (int run = 0; run < 300; run++) {
        size_t count = random32() % 3000;
        int extreme = run % 3;
        for (size_t i = 0; i < count; i++) {
            uint32_t p1 = 1 + random32() % 65535;
            if (extreme) p1 = p1 & 1 ? 1 + (p1 & 15) : 65535 - (p1 & 15);
            int likely = random32() % 65536 < p1;
            symbols[i] = (symbol){p1, extreme == 2 && random32() % 8 == 0 ? !likely : likely};
        }
        round_trip(symbols, count);
    }
}

/* Long runs of 0xFF bytes that a late carry turns, made by staying just below a boundary. */
static void test_carries(void) {
    for (int ones = 0; ones < 200; ones++) {
        size_t count = 0;
        symbols[count++] = (symbol){32768, 1};
        for (int i = 0; i < ones; i++) symbols[count++] = (symbol){32768, 0};
        for (int i = 0; i < 40; i++) symbols[count++] = (symbol){65535, i & 1};
        round_trip(symbols, count);
        symbols[0].bit = 0;
        round_trip(symbols, count);
    }
}

static void test_truncation_shows(void) {
    for (size_t i = 0; i < 4000; i++) symbols[i] = (symbol){32768, (int)(random32() >> 31)};
    lathe_range_encoder e;
    encode(&e, symbols, 4000);
    for (size_t size = 0; size + 12 < e.size; size += 7) {
        lathe_range_decoder d;
        lathe__decoder_start(&d, e.bytes, size);
        for (size_t i = 0; i < 4000; i++) lathe__decode_bit(&d, 32768);
        CHECK(d.overrun > 8);
    }
    lathe__encoder_free(&e);
}

static void test_garbage(void) {
    uint8_t bytes[64];
    for (int run = 0; run < 200; run++) {
        for (size_t i = 0; i < sizeof bytes; i++) bytes[i] = run == 0 ? 0xFF : (uint8_t)random32();
        lathe_range_decoder d;
        lathe__decoder_start(&d, bytes, sizeof bytes);
        for (int i = 0; i < 2000; i++) {
            int bit = lathe__decode_bit(&d, 1 + random32() % 65535);
            if (bit != 0 && bit != 1) CHECK(false);
        }
    }
    lathe_range_decoder d;
    lathe__decoder_start(&d, NULL, 0);
    CHECK_EQ(d.overrun, 4);
}

int main(void) {
    test_nothing();
    test_every_short_string();
    test_fair_bits_cost_one_bit();
    test_foreseen_bits_cost_nothing();
    test_unforeseen_bits_cost_sixteen();
    test_random_chances();
    test_carries();
    test_truncation_shows();
    test_garbage();
    return check_end();
}
