/* libFuzzer target: any bytes as a .nii or .nii.gz file. */
#include "volume_internal.h"
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    lathe_volume *volume = NULL;
    lathe_error err = {""};
    lathe_status status = lathe__volume_nifti_parse(&volume, bytes, size, &err);
    if ((status == LATHE_OK) != (volume != NULL) || (status && !err.text[0])) abort();
    if (volume && !(volume->min <= volume->max && lathe_volume_otsu(volume) >= volume->min)) abort();
    lathe_volume_close(&volume);
    return 0;
}
