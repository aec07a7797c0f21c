/* Names and colours of labels, from a table beside the volume. */
#ifndef LATHE_LABEL_TABLE_H
#define LATHE_LABEL_TABLE_H
#include "lathe.h"
#ifdef __cplusplus
extern "C" {
#endif

typedef struct lathe_label {
    int64_t label;
    char name[96];
    uint8_t rgb[3];
} lathe_label; /* name: valid UTF-8, not empty */
typedef struct lathe_label_table lathe_label_table;

/* For volume x.nii.gz, x.nii or x.json: names from x.nii.txt, else x.txt; colours from x.nii.lut, else x.lut (768 bytes: 256
 * red, 256 green, 256 blue). Lines are `INDEX NAME`, `INDEX NAME CODE` or FreeSurfer's `INDEX NAME R G B A`; '#' begins a
 * comment. No table is not an error: every label is then called "label-N" and gets a colour of its own.
 * Other lines are skipped and counted. Hostile files are safe. Errors: IO, LIMIT (over 4 MB), MEMORY. */
lathe_status lathe_label_table_open(lathe_label_table **out, const char *volume_path, lathe_error *err);
/* The same from memory. text: size bytes; lut: 768 bytes or NULL. */
lathe_status lathe_label_table_parse(lathe_label_table **out, const char *text, size_t size, const uint8_t *lut,
                                     lathe_error *err);
void lathe_label_table_close(lathe_label_table **table); /* NULL and a pointer to NULL are fine */

/* Always fills *out; false if the label is not in the table and its name was made up. Names of different labels differ. */
bool lathe_label_table_find(const lathe_label_table *table, int64_t label, lathe_label *out);
size_t lathe_label_table_count(const lathe_label_table *table);
const lathe_label *lathe_label_table_at(const lathe_label_table *table, size_t i); /* ascending by label; NULL beyond */
size_t lathe_label_table_malformed(const lathe_label_table *table);                /* lines that were skipped */

#ifdef __cplusplus
}
#endif
#endif
