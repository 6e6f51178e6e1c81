// Poll a server with simonvetter/modbus; see ask.py.
package main

import (
	"fmt"
	"log"
	"os"
	"strconv"
	"time"

	"github.com/simonvetter/modbus"
)

func main() {
	polls, _ := strconv.Atoi(os.Args[3])
	timeout, _ := strconv.ParseFloat(os.Args[4], 64)
	url := "rtu://" + os.Args[2]
	if os.Args[1] == "tcp" {
		url = "tcp://127.0.0.1:" + os.Args[2]
	}
	client, err := modbus.NewClient(&modbus.ClientConfiguration{
		URL: url, Speed: 19200, DataBits: 8, Parity: modbus.PARITY_NONE, StopBits: 1,
		Timeout: time.Duration(timeout * float64(time.Second)),
		Logger:  log.New(os.Stderr, "", 0),
	})
	if err == nil {
		err = client.Open()
	}
	if err != nil {
		log.Fatal(err)
	}
	client.SetUnitId(1)
	for k := 0; k < polls; k++ {
		values, err := client.ReadRegisters(uint16(2*k), 2, modbus.HOLDING_REGISTER)
		if err != nil {
			fmt.Println("error", err)
			continue
		}
		fmt.Print("ok")
		for _, value := range values {
			fmt.Print(" ", value)
		}
		fmt.Println()
	}
}
