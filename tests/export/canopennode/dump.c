/* Prints each variable of an object dictionary: index, sub-index, attributes, length and bytes (- without memory). */
#include <stdio.h>

#include "301/CO_ODinterface.h"
#include "OD.h"

static void print(const OD_entry_t *entry, int sub, OD_attr_t attribute, OD_size_t length, const void *data)
{
    const uint8_t *bytes = data;
    printf("%04X %d %d %02X %u ", entry->index, sub, entry->odObjectType, attribute, (unsigned)length);
    for (OD_size_t at = 0; bytes != NULL && at < length; at++) printf("%02X", bytes[at]);
    printf(bytes == NULL ? "-\n" : "\n");
}

int main(void)
{
    for (const OD_entry_t *entry = OD->list; entry < OD->list + OD->size; entry++) {
        const OD_obj_var_t *var = entry->odObject;
        const OD_obj_array_t *array = entry->odObject;
        const OD_obj_record_t *record = entry->odObject;
        for (int at = 0; at < entry->subEntriesCount; at++) {
            if (entry->odObjectType == ODT_VAR)
                print(entry, 0, var->attribute, var->dataLength, var->dataOrig);
            else if (entry->odObjectType == ODT_REC)
                print(entry, record[at].subIndex, record[at].attribute, record[at].dataLength, record[at].dataOrig);
            else if (at == 0)
                print(entry, 0, array->attribute0, 1, array->dataOrig0);
            else
                print(entry, at, array->attribute, array->dataElementLength, array->dataOrig == NULL ? NULL :
                      (const uint8_t *)array->dataOrig + array->dataElementSizeof * (OD_size_t)(at - 1));
        }
    }
    return 0;
}
