/* What an object dictionary for CANopenNode 4 is made of: the names, types and values that its own header declares.
 * Written for the tests, from the interface's description; nothing of the stack is in it. */
#ifndef OD_INTERFACE_OF_THE_TESTS_H
#define OD_INTERFACE_OF_THE_TESTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CO_VERSION_MAJOR 4
#define CO_PROGMEM const

typedef bool bool_t;
typedef float float32_t;
typedef double float64_t;
typedef uint32_t OD_size_t;
typedef uint8_t OD_attr_t;

enum {
    ODA_SDO_R = 0x01, ODA_SDO_W = 0x02, ODA_SDO_RW = 0x03,
    ODA_TPDO = 0x04, ODA_RPDO = 0x08, ODA_TRPDO = 0x0C,
    ODA_TSRDO = 0x10, ODA_RSRDO = 0x20, ODA_TRSRDO = 0x30,
    ODA_MB = 0x40, ODA_STR = 0x80
};
enum { ODT_VAR = 1, ODT_ARR = 2, ODT_REC = 3 };

typedef struct { void *object; } OD_extension_t;
typedef struct {
    uint16_t index;
    uint8_t subEntriesCount, odObjectType;
    CO_PROGMEM void *odObject;
    OD_extension_t *extension;
} OD_entry_t;
typedef struct { uint16_t size; OD_entry_t *list; } OD_t;

typedef struct { void *dataOrig; OD_attr_t attribute; OD_size_t dataLength; } OD_obj_var_t;
typedef struct {
    uint8_t *dataOrig0;
    void *dataOrig;
    OD_attr_t attribute0, attribute;
    OD_size_t dataElementLength, dataElementSizeof;
} OD_obj_array_t;
typedef struct { void *dataOrig; uint8_t subIndex; OD_attr_t attribute; OD_size_t dataLength; } OD_obj_record_t;

#endif
