/* Poll a server with libmodbus; see ask.py. */
#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(int argc, char **argv)
{
    if (argc != 5)
        return 2;
    int tcp = !strcmp(argv[1], "tcp"), polls = atoi(argv[3]);
    double timeout = atof(argv[4]);
    modbus_t *client = tcp ? modbus_new_tcp("127.0.0.1", atoi(argv[2]))
                           : modbus_new_rtu(argv[2], 19200, 'N', 8, 1);
    if (!client)
        return 2;
    modbus_set_slave(client, 1);
    modbus_set_response_timeout(client, (int)timeout, (timeout - (int)timeout) * 1e6);
    if (modbus_connect(client))
        return 2;
    setvbuf(stdout, NULL, _IOLBF, 0);
    for (int k = 0; k < polls; k++) {
        uint16_t values[2];
        int found = modbus_read_registers(client, 2 * k, 2, values);
        if (found < 0) {
            printf("error %s\n", modbus_strerror(errno));
            continue;
        }
        printf("ok");
        for (int i = 0; i < found; i++)
            printf(" %u", values[i]);
        printf("\n");
    }
    modbus_close(client);
    modbus_free(client);
    return 0;
}
